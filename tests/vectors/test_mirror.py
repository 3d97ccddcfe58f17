"""The left-right mirror against a mirrored world."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lmtr.segmentation.window import cut, valid_epochs
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from lmtr.vectors.mirror import mirror_segment, mirror_task
from lmtr.vectors.segment_vector import encode_segment
from lmtr.vectors.state import state_at
from lmtr.vectors.task_vector import encode_task

SWAPPED = [1, 0, 3, 2]
FLIP = np.array([1.0, -1.0, 1.0])


def reflected(trajectory):
    """The trajectory seen in a mirror in the x-z plane of the world."""
    base = trajectory.base_nodes * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    swing = trajectory.swing_nodes * np.array([1.0, -1.0, 1.0, 1.0, -1.0])
    return replace(
        trajectory,
        base_nodes=base,
        contact_times=trajectory.contact_times[..., SWAPPED, :],
        footholds=(trajectory.footholds * FLIP)[..., SWAPPED, :, :],
        swing_nodes=swing[..., SWAPPED, :, :],
        force_nodes=(trajectory.force_nodes * FLIP)[..., SWAPPED, :, :, :, :],
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_mirrored_vectors_are_those_of_the_mirrored_world(walk, seed):
    example, epochs = walk(seed), np.array([0.0, 0.9, 2.345, 3.1, 4.0])
    epochs = epochs[valid_epochs(example.trajectory, epochs)]
    assert len(epochs) >= 3
    lines, goal = example.task.obstacles_W, example.task.goal_pose_W
    trajectory, image = example.trajectory, reflected(example.trajectory)
    tau = encode_segment(cut(trajectory, epochs))
    assert mirror_segment(tau) == pytest.approx(encode_segment(cut(image, epochs)), abs=1e-9)
    x = encode_task(state_at(trajectory, epochs), lines, goal)
    other = encode_task(
        state_at(image, epochs), lines * [1.0, -1.0, -1.0], goal * [1.0, -1.0, -1.0]
    )
    assert mirror_task(x) == pytest.approx(other, abs=1e-9)


@given(seed=st.integers(0, 2**32 - 1))
def test_two_mirrors_show_the_original(seed):
    rng = np.random.default_rng(seed)
    tau = rng.normal(size=(4, SEGMENT_LAYOUT.size))
    assert np.array_equal(mirror_segment(mirror_segment(tau)), tau)
    x = rng.normal(size=(4, TASK_LAYOUT.size))
    lines = TASK_LAYOUT.unpack(x)["next_lines"]  # a view
    lines[..., 2] = rng.uniform(0.0, np.pi, (4, 2))
    assert mirror_task(mirror_task(x)) == pytest.approx(x, abs=1e-15)


def test_a_line_along_the_path_keeps_its_one_description():
    x = np.zeros(TASK_LAYOUT.size)
    assert np.array_equal(TASK_LAYOUT.unpack(mirror_task(x))["next_lines"][:, 2], [0.0, 0.0])
