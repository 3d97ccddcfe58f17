"""Where a decoded segment has the feet at its epoch, as a function that training can differentiate.

A segment starts from the state χ of its task, so its feet at t = 0 are known. The 264 numbers of τ
say so only together: a swinging foot's place follows from lift-off, touch-down, both footholds and
the mid-swing node, and small errors of each add up to centimetres. What a plan misses here is how
far its feet jump at replanning.
"""

import numpy as np
import torch
from torch import Tensor

from lmtr.robot.model import FEET
from lmtr.spline import hermite
from lmtr.vectors.layout import SEGMENT_LAYOUT
from lmtr.vectors.scaling import Standardiser
from lmtr.vectors.segment_vector import MIN_PHASE

UNIT = 0.1
"""Length (m) that counts like one standard deviation of a dimension of τ."""

NEEDED = ("times", "first_foothold", "swing_position", "swing_velocity", "second_foothold")
"""Fields of each foot that its place follows from."""


class EpochFeet:
    """Feet of standardised segments at t = 0.

    Args:
        scaling: Standardisation of τ.
        device: Where segments are.
    """

    def __init__(self, scaling: Standardiser, device: torch.device) -> None:
        self._scale, self._mean = (
            torch.as_tensor(values, dtype=torch.float32, device=device)
            for values in (scaling.scale, scaling.mean)
        )
        rows = np.arange(SEGMENT_LAYOUT.size)
        self._places = [
            torch.as_tensor(
                np.stack([rows[SEGMENT_LAYOUT.slice(f"{f}_{name}")] for f in FEET]), device=device
            )
            for name in NEEDED
        ]

    def __call__(self, tau: Tensor) -> Tensor:
        """Positions (B, 4, 3) in m, _S, of the feet of segments τ (B, 264), standardised."""
        times, first, middle, velocity, second = (
            tau[:, place] * self._scale[place] + self._mean[place] for place in self._places
        )  # (B, 4, ·)
        liftoff, touchdown = times[..., 1:2], times[..., 2:3]
        duration = (touchdown - liftoff).clamp(min=MIN_PHASE)
        # Two cubics of half the swing each; a standing foot is at one of their outer ends.
        local = 2.0 * (-liftoff / duration).clamp(0.0, 1.0)
        later = local >= 1.0
        passing = torch.nn.functional.pad(velocity, (0, 1))
        still = torch.zeros_like(passing)
        feet: Tensor = hermite.value(
            local - later.to(local.dtype),
            torch.where(later, middle, first),
            torch.where(later, passing, still),
            torch.where(later, second, middle),
            torch.where(later, still, passing),
            0.5 * duration,
        )
        return feet

    def error(self, tau: Tensor, tau_hat: Tensor) -> Tensor:
        """Mean absolute difference per coordinate of τ's and τ̂'s feet, scalar, in :data:`UNIT`."""
        return (self(tau_hat) - self(tau)).abs().mean() / UNIT
