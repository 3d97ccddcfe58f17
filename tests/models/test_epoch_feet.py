"""Feet at the epoch, as training sees them, against the trajectory's own sampling."""

import numpy as np
import pytest
import torch

from lmtr.models.epoch_feet import UNIT, EpochFeet
from lmtr.trajectory.sample import sample_feet
from lmtr.vectors.layout import SEGMENT_LAYOUT
from lmtr.vectors.scaling import Standardiser
from lmtr.vectors.segment_vector import decode_segment, encode_segment


@pytest.fixture
def feet(walk_segments):
    scaling = Standardiser.fit(SEGMENT_LAYOUT, walk_segments.tau)
    return scaling, EpochFeet(scaling, torch.device("cpu"))


def _tensor(scaling, tau):
    return torch.as_tensor(scaling.apply(tau), dtype=torch.float32)


def test_feet_stand_and_swing_where_the_sampled_trajectory_has_them(feet, walk_segments):
    scaling, at_epoch = feet
    sampled = sample_feet(decode_segment(walk_segments.tau), np.zeros((len(walk_segments.tau), 1)))
    since, contact = sampled.time_since_liftoff[:, 0], sampled.contact[:, 0]
    swing = decode_segment(walk_segments.tau).contact_times
    progress = (since / (swing[..., 2] - swing[..., 1]))[~contact]
    assert contact.any()  # all three: stance, and both halves of the swing
    assert (progress < 0.5).any()
    assert (progress > 0.5).any()
    found = at_epoch(_tensor(scaling, walk_segments.tau)).numpy()
    np.testing.assert_allclose(found, sampled.position[:, 0], atol=2e-6)


@pytest.mark.parametrize(
    "name", ["times", "first_foothold", "swing_position", "swing_velocity", "second_foothold"]
)
def test_its_derivative_is_that_of_finite_differences(feet, walk_segments, name):
    scaling, at_epoch = feet
    times = decode_segment(walk_segments.tau).contact_times[:, 1]  # of RF
    progress = -times[:, 1] / (times[:, 2] - times[:, 1])
    # A foot that lifts off, passes the middle or touches down within the step has a kink there.
    swings = ((progress > 0.1) & (progress < 0.4)) | ((progress > 0.6) & (progress < 0.9))
    assert swings.sum() > 5
    tau = _tensor(scaling, walk_segments.tau[swings]).requires_grad_()
    at_epoch(tau)[:, 1].sum().backward()
    step, columns = 0.01, range(SEGMENT_LAYOUT.size)[SEGMENT_LAYOUT.slice(f"RF_{name}")]
    for column in columns:
        aside = torch.zeros(SEGMENT_LAYOUT.size)
        aside[column] = step
        with torch.no_grad():
            change = at_epoch(tau + aside)[:, 1] - at_epoch(tau - aside)[:, 1]
        apart = (change.sum(dim=1) / (2 * step) - tau.grad[:, column]).abs()
        assert float(apart.max()) < 1e-3
    assert float(tau.grad[:, list(columns)].abs().max()) > 0.01


def test_the_error_of_feet_that_are_moved_is_how_far(feet, walk_segments):
    scaling, at_epoch = feet
    moved = decode_segment(walk_segments.tau)
    moved.footholds[...] += np.array([0.02, -0.04, 0.0])
    moved.swing_nodes[..., :2] += np.array([0.02, -0.04])
    error = at_epoch.error(
        _tensor(scaling, walk_segments.tau), _tensor(scaling, encode_segment(moved))
    )
    assert float(error) == pytest.approx(0.02 / UNIT, rel=1e-3)  # the mean of 2, 4 and 0 cm
