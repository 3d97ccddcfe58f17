"""The segment vector gives back what it was made from."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lmtr.errors import DataError
from lmtr.segmentation.window import cut
from lmtr.trajectory.sample import sample_base, sample_feet
from lmtr.vectors.layout import SEGMENT_LAYOUT
from lmtr.vectors.segment_vector import MIN_PHASE, decode_segment, encode_segment, ordered_times

EPOCHS = np.array([0.0, 1.234, 3.3, 5.05])


def test_decoding_gives_back_the_segment_exactly(walk):
    segment = cut(walk(1).trajectory, EPOCHS)
    decoded = decode_segment(encode_segment(segment))
    for field in fields(segment):
        assert np.array_equal(getattr(decoded, field.name), getattr(segment, field.name)), field


@given(seed=st.integers(0, 2**32 - 1))
def test_vectors_of_valid_times_are_given_back_exactly(seed):
    rng = np.random.default_rng(seed)
    tau = rng.normal(size=(3, SEGMENT_LAYOUT.size))
    times = SEGMENT_LAYOUT.category_indices()["times"].reshape(4, 4)
    tau[:, times] = np.cumsum(rng.uniform(MIN_PHASE + 1e-6, 1.0, (3, 4, 4)), axis=-1) - 1.0
    assert np.array_equal(encode_segment(decode_segment(tau)), tau)


def test_each_quantity_lands_in_its_field(walk):
    segment = cut(walk(2).trajectory, EPOCHS)
    parts = SEGMENT_LAYOUT.unpack(encode_segment(segment))
    assert parts["base_nodes"][2, 3, 1, 5] == segment.base_nodes[2, 3, 1, 5]
    assert parts["RF_times"][1, 2] == segment.touchdown_times[1, 1, 0]
    assert np.array_equal(parts["LH_second_foothold"], segment.footholds[:, 2, 1])
    assert np.array_equal(parts["RH_forces"][:, 0, 1], segment.force_nodes[:, 3, 0, 1])
    assert np.array_equal(parts["RH_forces"][:, 1, 1], segment.force_nodes[:, 3, 1, 2])


@given(times=arrays(float, (5, 4, 4), elements=st.floats(-3.0, 3.0)))
def test_predicted_times_are_made_to_ascend_around_the_liftoff(times):
    ordered = ordered_times(times)
    assert (np.diff(ordered, axis=-1) >= MIN_PHASE - 1e-12).all()
    assert np.array_equal(ordered[..., 1], times[..., 1])
    assert np.array_equal(ordered_times(ordered), ordered)


def test_any_prediction_can_be_evaluated():
    tau = np.random.default_rng(0).normal(size=(20, SEGMENT_LAYOUT.size))
    segment, times = decode_segment(tau), np.broadcast_to(np.linspace(0.0, 0.8, 17), (20, 17))
    feet = sample_feet(segment, times)
    assert np.isfinite(feet.position).all()
    assert np.isfinite(feet.force).all()
    assert np.isfinite(sample_base(segment, times).position).all()


def test_another_scope_is_refused(walk):
    with pytest.raises(DataError, match=r"9 base nodes and 2 stances.*76 and 7"):
        encode_segment(walk(1).trajectory)


def test_a_late_start_is_refused(walk):
    segment = cut(walk(1).trajectory, EPOCHS)
    with pytest.raises(DataError, match="base_start must be 0"):
        encode_segment(replace(segment, base_start=segment.base_start + 0.1))


def test_a_push_while_lifting_off_is_refused(walk):
    segment = cut(walk(1).trajectory, EPOCHS)
    forces = segment.force_nodes.copy()
    forces[1, 2, 0, -1, 0, 2] = 7.0
    with pytest.raises(DataError, match=r"shared with the swing.*7"):
        encode_segment(replace(segment, force_nodes=forces))
