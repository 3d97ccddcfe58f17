"""Windows hold the solution's own motion; unsuitable epochs are refused."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lmtr.errors import DataError
from lmtr.geometry.se2 import SE2
from lmtr.segmentation.window import cut, rest_time, valid_epochs
from lmtr.trajectory.sample import sample_base, sample_feet
from lmtr.vectors.segment_vector import decode_segment, encode_segment

TIMES = np.linspace(0.0, 0.8, 33)
PLACE = SE2.of([1.5, -2.0, 0.8])
SEEDS = st.integers(1, 4)


def decoded_in_world(trajectory, epoch):
    """What τ says of the motion from ``epoch`` on, put back to its place and time."""
    tau = encode_segment(cut(trajectory, np.array([epoch])))
    base = sample_base(trajectory, np.array([epoch]))
    frame = SE2.of([*base.position[0, :2], base.rpy[0, 2]])
    return decode_segment(tau)[0].moved(frame, epoch)


def some_valid_epoch(trajectory, share):
    candidates = np.linspace(0.0, 6.7, 671)
    valid = candidates[valid_epochs(trajectory, candidates)]
    return float(valid[int(share * (len(valid) - 1))])


@settings(max_examples=60)
@given(seed=SEEDS, share=st.floats(0.0, 1.0), offset=st.floats(-0.009, 0.0))
def test_feet_forces_and_contacts_are_the_solutions_own_at_every_epoch(walk, seed, share, offset):
    trajectory = walk(seed).trajectory.moved(PLACE)
    epoch = some_valid_epoch(trajectory, share) + offset
    assume(valid_epochs(trajectory, np.array([epoch]))[0])
    window = decoded_in_world(trajectory, epoch)
    mine, theirs = (sample_feet(t, epoch + TIMES + 1e-7) for t in (window, trajectory))
    assert np.array_equal(mine.contact, theirs.contact)
    assert mine.position == pytest.approx(theirs.position, abs=1e-9)
    assert mine.velocity == pytest.approx(theirs.velocity, abs=1e-8)
    assert mine.force == pytest.approx(theirs.force, abs=1e-6)
    assert mine.time_since_liftoff == pytest.approx(theirs.time_since_liftoff, abs=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("share", [0.0, 0.15, 0.5, 0.9])
def test_base_is_the_solutions_own_for_epochs_on_knots(walk, seed, share):
    trajectory = walk(seed).trajectory.moved(PLACE)
    knots = 0.1 * np.arange(len(trajectory.base_nodes))
    valid = knots[valid_epochs(trajectory, knots)]
    epoch = valid[int(share * len(valid))]
    window = decoded_in_world(trajectory, epoch)
    mine, theirs = (sample_base(t, epoch + TIMES) for t in (window, trajectory))
    for quantity in ("position", "rpy", "velocity", "rpy_rate"):
        assert getattr(mine, quantity) == pytest.approx(getattr(theirs, quantity), abs=1e-9)


@settings(max_examples=40)
@given(seed=SEEDS, share=st.floats(0.0, 1.0), offset=st.floats(-0.05, 0.0))
def test_base_between_knots_is_resampled_closely(walk, seed, share, offset):
    trajectory = walk(seed).trajectory.moved(PLACE)
    epoch = some_valid_epoch(trajectory, share) + offset
    assume(valid_epochs(trajectory, np.array([epoch]))[0])
    window = decoded_in_world(trajectory, epoch)
    mine, theirs = (sample_base(t, epoch + TIMES) for t in (window, trajectory))
    assert np.abs(mine.position - theirs.position).max() < 1e-4
    assert np.abs(mine.rpy - theirs.rpy).max() < 3e-4
    assert np.abs(mine.velocity - theirs.velocity).max() < 1e-2


@given(x=st.floats(-9.0, 9.0), y=st.floats(-9.0, 9.0), yaw=st.floats(-3.0, 3.0))
def test_segments_do_not_change_when_the_world_is_moved(walk, x, y, yaw):
    trajectory, epochs = walk(2).trajectory, np.array([0.3, 2.71, 4.9])
    here = encode_segment(cut(trajectory, epochs))
    there = encode_segment(cut(trajectory.moved(SE2.of([x, y, yaw]), 3.0), epochs + 3.0))
    assert there == pytest.approx(here, abs=1e-8)


def test_the_first_stance_is_the_current_one_or_the_one_before_the_swing(walk):
    trajectory = walk(1).trajectory
    foot, swing = 2, 3
    liftoff, touchdown = (
        trajectory.liftoff_times[foot, swing],
        trajectory.touchdown_times[foot, swing],
    )
    epochs = np.array([liftoff - 0.02, 0.5 * (liftoff + touchdown), touchdown + 0.02])
    times = cut(trajectory, epochs).contact_times[:, foot] + epochs[:, None]
    assert times[0, 1:3] == pytest.approx([liftoff, touchdown])
    assert times[1] == pytest.approx(times[0])
    assert times[2, 0] == pytest.approx(touchdown)


def test_the_segment_frame_lies_under_the_base_along_its_yaw(walk):
    segments = cut(walk(3).trajectory.moved(PLACE), np.array([0.0, 1.11, 3.14]))
    start = segments.base_nodes[:, 0, 0]
    assert start[:, [0, 1, 5]] == pytest.approx(0.0, abs=1e-12)
    assert (start[:, 2] > 0.3).all()
    assert (segments.base_start == 0.0).all()


def test_a_second_swing_within_the_window_is_refused(walk):
    trajectory = walk(1).trajectory
    hasty = trajectory.contact_times.copy()
    liftoff, touchdown = hasty[0, 5], hasty[0, 6]
    hasty[0, 7] = touchdown + 0.2  # up again 0.2 s after landing
    hasty[0, 8] = touchdown + 0.4
    hurried = replace(trajectory, contact_times=hasty)
    epochs = np.array([liftoff - 0.01, touchdown - 0.61, touchdown - 0.59])
    assert valid_epochs(trajectory, epochs).all()
    assert valid_epochs(hurried, epochs).tolist() == [False, True, False]


def test_windows_that_reach_into_rest_are_refused(walk):
    trajectory = walk(1).trajectory
    nodes = trajectory.base_nodes.copy()
    nodes[40:, 0], nodes[40:, 1] = nodes[40, 0], 0.0
    # Four jumps, the last one landing at 3.7 s: all feet still have a swing at 3.2 s.
    events = [0.0, 0.5, 0.8, 1.5, 1.8, 2.5, 2.8, 3.4, 3.7, 7.5]
    rested = replace(
        trajectory,
        base_nodes=nodes,
        contact_times=np.tile(events, (4, 1)),
        footholds=trajectory.footholds[:, :5],
        swing_nodes=trajectory.swing_nodes[:, :4],
        force_nodes=trajectory.force_nodes[:, :5],
    )
    assert rest_time(rested) == pytest.approx(4.0)
    late = np.array([3.19, 3.21])
    assert valid_epochs(rested, late).tolist() == [True, False]
    with pytest.raises(DataError, match=r"epoch 3\.210 s .* rests from 4\.000 s"):
        cut(rested, late)


def test_nothing_is_cut_before_the_start_or_once_a_foot_has_landed_for_good(walk):
    trajectory = walk(1).trajectory
    last = trajectory.touchdown_times[:, -1].min()
    assert valid_epochs(trajectory, np.array([-0.01, last + 0.001])).tolist() == [False, False]
