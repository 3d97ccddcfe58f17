"""Policies π: x → z that choose the mode of a plan (Sec. 3.3)."""

from hashlib import blake2b
from typing import Any, Protocol

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import DataError
from lmtr.policies.distance import TaskWeights
from lmtr.policies.mode_library import ModeLibrary
from lmtr.policies.nearest_neighbour import TaskIndex
from lmtr.streams import Purpose, stream
from lmtr.vectors.scaling import Standardiser

DIGITS = 6
"""Decimals of a task that decide a draw."""


class ModePolicy(Protocol):
    """What LMTR asks of a policy; a new one needs no more than this.

    Attributes:
        name: Short, for tables and figures.
        latent: n, dimensions of the modes that it selects.
        nbytes: Memory that selecting needs (bytes).
    """

    @property
    def name(self) -> str: ...  # noqa: D102 - the class docstring has all three

    @property
    def latent(self) -> int: ...  # noqa: D102

    @property
    def nbytes(self) -> int: ...  # noqa: D102

    def select(self, x: Array) -> Array:
        """Modes z (B, n) for tasks x (B, 35); each row depends on its own task alone."""
        ...

    def describe(self) -> dict[str, Any]:
        """Settings as plain JSON types, for provenance."""
        ...


class NearestModePolicy:
    """π_nbr: the mode that the expert chose in the most similar task (Eq. 7).

    Args:
        library: D_z.
        weights: w of the task distance.
        standardiser: Scaling of the task dimensions.
    """

    name = "nearest"

    def __init__(
        self, library: ModeLibrary, weights: TaskWeights, standardiser: Standardiser
    ) -> None:
        if len(library.x) != len(library.z):
            raise DataError(
                f"mode library: tasks and modes must be as many, got {len(library.x)} and "
                f"{len(library.z)}; encode the library anew"
            )
        self._weights, self._z = weights, library.z
        self._index = TaskIndex(library.x, weights, standardiser)

    @property
    def latent(self) -> int:
        """N."""
        return int(self._z.shape[1])

    @property
    def nbytes(self) -> int:
        """Memory of D_z (bytes)."""
        return self._index.nbytes + self._z.nbytes

    def select(self, x: Array) -> Array:
        """The expert's modes (B, n) in the tasks nearest to x (B, 35)."""
        return self.suggest(x, 1)[:, 0]

    def suggest(self, x: Array, count: int) -> Array:
        """The expert's modes (B, count, n) in the tasks nearest to x (B, 35), nearest first."""
        _, rows = self._index.query(x, count)
        return np.asarray(self._z[rows], dtype=np.float64)

    def describe(self) -> dict[str, Any]:
        """Weights and size of the library."""
        weights = self._weights.model_dump()
        return {"policy": self.name, "weights": weights, "rows": len(self._index)}


class ZeroModePolicy:
    """The prior's most likely mode, whatever the task: a control for how much π_nbr matters.

    Args:
        latent: n.
    """

    name = "zero"
    nbytes = 0

    def __init__(self, latent: int) -> None:
        self.latent = latent

    def select(self, x: Array) -> Array:
        """Zeros (B, n) for tasks x (B, 35)."""
        return np.zeros((len(x), self.latent))

    def describe(self) -> dict[str, Any]:
        """Its name; it has no settings."""
        return {"policy": self.name}


class PriorModePolicy:
    """A mode drawn from the prior N(0, I): the second control.

    The draw is a function of seed and task, so that rollouts are the same in whatever order they
    are planned; tasks are rounded first, for in batches of another size they differ in the last
    digits.

    Args:
        latent: n.
        seed: Seed of the draws.
    """

    name = "prior"
    nbytes = 0

    def __init__(self, latent: int, seed: int) -> None:
        self.latent, self._seed = latent, seed

    def select(self, x: Array) -> Array:
        """Draws (B, n) for tasks x (B, 35)."""
        z = np.empty((len(x), self.latent))
        rounded = np.round(np.asarray(x, dtype=np.float64), DIGITS) + 0.0  # no zero is negative
        for row, task in enumerate(np.ascontiguousarray(rounded)):
            digest = blake2b(task.tobytes(), digest_size=8).digest()
            rng = stream(self._seed, Purpose.PRIOR, int.from_bytes(digest, "little"))
            z[row] = rng.standard_normal(self.latent)
        return z

    def describe(self) -> dict[str, Any]:
        """Its seed."""
        return {"policy": self.name, "seed": self._seed}
