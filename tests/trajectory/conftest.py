"""Trajectories of every size, with numbers that mean nothing: laws must hold for them too."""

from collections.abc import Callable

import numpy as np
import pytest

from lmtr.robot.model import N_FEET
from lmtr.trajectory.trajectory import FORCE_PIECES, Trajectory


def random_trajectory(
    seed: int, stances: int = 3, nodes: int = 6, batch: tuple[int, ...] = ()
) -> Trajectory:
    rng = np.random.default_rng(seed)
    start = rng.uniform(-1.0, 1.0, batch)
    phases = rng.uniform(0.1, 0.4, (*batch, N_FEET, 2 * stances))
    forces = rng.normal(size=(*batch, N_FEET, stances, FORCE_PIECES + 1, 2, 3))
    return Trajectory(
        base_start=start,
        base_nodes=rng.normal(size=(*batch, nodes, 2, 6)),
        contact_times=start[..., None, None] + np.cumsum(phases, axis=-1) - 0.4,
        footholds=rng.normal(size=(*batch, N_FEET, stances, 3)),
        swing_nodes=rng.normal(size=(*batch, N_FEET, stances - 1, 5)),
        force_nodes=forces,
    )


@pytest.fixture(scope="session")
def scramble() -> Callable[..., Trajectory]:
    """Random trajectories by seed, stances, nodes and batch."""
    return random_trajectory
