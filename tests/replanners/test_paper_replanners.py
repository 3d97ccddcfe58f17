"""What tells the paper's replanners apart (Eqs. 6 to 8)."""

import numpy as np
import pytest

from lmtr.errors import DataError, ModelError
from lmtr.policies.distance import TaskWeights
from lmtr.policies.mode_policy import ZeroModePolicy
from lmtr.replanners.build import build_replanner
from lmtr.replanners.latent_mode import LatentModeReplanner
from lmtr.replanners.trajectory_library import TrajectoryLibraryReplanner
from lmtr.replanners.unimodal import UnimodalReplanner
from lmtr.vectors.layout import TASK_LAYOUT
from lmtr.vectors.scaling import Standardiser


def test_the_library_returns_the_experts_own_segment(walk_segments):
    library = build_replanner(None, walk_segments, TaskWeights())
    np.testing.assert_allclose(
        library.plan(walk_segments.x), walk_segments.tau, rtol=1e-6, atol=1e-6
    )


def test_lmtr_in_the_experts_mode_is_nearer_to_it_than_in_any_other(models, walk_segments):
    model = models[3]
    scale = model.segment_scaling

    def error(replanner):
        return np.abs(
            scale.apply(replanner.plan(walk_segments.x)) - scale.apply(walk_segments.tau)
        ).mean()

    nearest = build_replanner(model, walk_segments, TaskWeights())
    assert error(nearest) < 0.95 * error(LatentModeReplanner(model, ZeroModePolicy(3)))


def test_lmtr_plans_with_the_policys_mode(models, walk_segments):
    model = models[3]
    mu, _ = model.encode(walk_segments.tau, walk_segments.x)
    expected = model.predict(walk_segments.x, mu)
    planned = build_replanner(model, walk_segments, TaskWeights()).plan(walk_segments.x)
    np.testing.assert_allclose(planned, expected, rtol=1e-9, atol=1e-9)


def test_a_model_and_a_replanner_that_do_not_fit_are_refused(models):
    with pytest.raises(ModelError, match=r"latent = 0, got LMTR-3"):
        UnimodalReplanner(models[3])
    with pytest.raises(ModelError, match=r"LMTR-3 has 3 .* selects 2"):
        LatentModeReplanner(models[3], ZeroModePolicy(2))
    with pytest.raises(ModelError, match=r"unimodal has 0"):
        LatentModeReplanner(models[0], ZeroModePolicy(0))


def test_a_library_that_is_not_whole_is_refused(walk_segments):
    scaling = Standardiser.fit(TASK_LAYOUT, walk_segments.x)
    with pytest.raises(DataError, match="as many"):
        TrajectoryLibraryReplanner(walk_segments.x, walk_segments.tau[:-1], TaskWeights(), scaling)
    broken = walk_segments.tau.copy()
    broken[0, 0] = np.nan
    with pytest.raises(DataError, match=r"library segments: .*base_nodes"):
        TrajectoryLibraryReplanner(walk_segments.x, broken, TaskWeights(), scaling)


def test_footprints_are_ordered_as_in_the_paper(models, walk_segments):
    """Trajectories take more room than modes: 264 numbers a row against n (Sec. 4.3)."""
    repeated = type(walk_segments)(
        np.tile(walk_segments.x, (20, 1)), np.tile(walk_segments.tau, (20, 1))
    )
    unimodal, lmtr, library = (
        build_replanner(model, repeated, TaskWeights()).nbytes
        for model in (models[0], models[3], None)
    )
    assert unimodal < lmtr < library
