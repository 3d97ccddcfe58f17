"""Random streams: the same again, and none like another."""

from itertools import combinations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lmtr.streams import Purpose, stream

seeds = st.integers(0, 2**63 - 1)
indices = st.integers(0, 2**64 - 1)


@given(seed=seeds, purpose=st.sampled_from(Purpose), index=indices)
def test_a_stream_is_the_same_whenever_it_is_asked_for(seed, purpose, index):
    first, again = (stream(seed, purpose, index).random(4) for _ in range(2))
    assert np.array_equal(first, again)


@given(seed=seeds, first=indices, second=indices)
def test_no_two_purposes_share_a_draw(seed, first, second):
    for one, other in combinations(Purpose, 2):
        draws = stream(seed, one, first).random(4), stream(seed, other, second).random(4)
        assert not np.isin(*draws).any(), (one, other)


@given(seed=seeds, purpose=st.sampled_from(Purpose), pair=st.tuples(indices, indices))
def test_no_two_indices_share_a_draw(seed, purpose, pair):
    if pair[0] != pair[1]:
        draws = (stream(seed, purpose, index).random(4) for index in pair)
        assert not np.isin(*draws).any()


def test_streams_of_one_seed_are_uncorrelated():
    draws = np.array([[stream(0, p, k).random() for k in range(2000)] for p in Purpose])
    correlation = np.corrcoef(draws) - np.eye(len(Purpose))
    assert np.abs(correlation).max() < 4.0 / np.sqrt(2000)


def test_the_numbers_of_purposes_are_part_of_stored_data():
    assert [purpose.value for purpose in Purpose] == list(range(len(Purpose)))
    assert (Purpose.TASK, Purpose.SEGMENTS, Purpose.COURSE, Purpose.START) == (0, 1, 2, 3)
