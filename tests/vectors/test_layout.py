"""Layouts against the contract: totals, order, round trips, refusals."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lmtr.errors import DataError
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT, Field, Layout

LAYOUTS = pytest.mark.parametrize("layout", [TASK_LAYOUT, SEGMENT_LAYOUT], ids=lambda x: x.name)


def test_sizes_are_those_of_the_paper():
    assert TASK_LAYOUT.size == 35
    assert SEGMENT_LAYOUT.size == 264


def test_categories_share_out_the_task_vector():
    sizes = {name: len(index) for name, index in TASK_LAYOUT.category_indices().items()}
    assert sizes == {"chi_base": 9, "chi_feet": 16, "eta": 6, "gamma": 4}


def test_categories_share_out_the_segment_vector():
    sizes = {name: len(index) for name, index in SEGMENT_LAYOUT.category_indices().items()}
    assert sizes == {"base": 108, "times": 4 * 4, "motion": 4 * 11, "forces": 4 * 24}


def test_order_of_the_task_vector_is_the_contract():
    starts = {name: part.start for name, part in TASK_LAYOUT.slices.items()}
    assert starts == {
        "height": 0,
        "roll_pitch": 1,
        "linear_velocity": 3,
        "angular_velocity": 6,
        "LF_position": 9,
        "LF_time_since_liftoff": 12,
        "RF_position": 13,
        "RF_time_since_liftoff": 16,
        "LH_position": 17,
        "LH_time_since_liftoff": 20,
        "RH_position": 21,
        "RH_time_since_liftoff": 24,
        "next_lines": 25,
        "goal_position": 31,
        "goal_heading": 33,
    }


def test_order_of_the_segment_vector_is_the_contract():
    assert SEGMENT_LAYOUT.slice("base_nodes") == slice(0, 108)
    own = {"times": 0, "first_foothold": 4, "swing_position": 7, "swing_velocity": 10}
    own |= {"second_foothold": 12, "forces": 15}
    for index, foot in enumerate(("LF", "RF", "LH", "RH")):
        for quantity, offset in own.items():
            assert SEGMENT_LAYOUT.slice(f"{foot}_{quantity}").start == 108 + 39 * index + offset


@LAYOUTS
def test_every_number_belongs_to_one_field_and_one_category(layout):
    owned = np.concatenate(list(layout.category_indices().values()))
    assert sorted(owned.tolist()) == list(range(layout.size))
    for name, part in layout.slices.items():
        assert all(layout.field_at(i).name == name for i in range(part.start, part.stop))


@LAYOUTS
@given(seed=st.integers(0, 2**32 - 1), batch=st.sampled_from([(), (3,), (2, 1, 4)]))
def test_packing_gives_back_what_was_unpacked(layout, seed, batch):
    vectors = np.random.default_rng(seed).normal(size=(*batch, layout.size))
    assert np.array_equal(layout.pack(layout.unpack(vectors)), vectors)


def test_packing_broadcasts_batches():
    parts = TASK_LAYOUT.unpack(np.zeros(TASK_LAYOUT.size))
    parts["height"] = np.array([0.4, 0.5])
    assert TASK_LAYOUT.unpack(TASK_LAYOUT.pack(parts))["height"].tolist() == [0.4, 0.5]


def test_packing_refuses_missing_unknown_and_misshapen_fields():
    parts = TASK_LAYOUT.unpack(np.zeros(TASK_LAYOUT.size))
    with pytest.raises(DataError, match=r"missing \['height'\], unknown \['heigth'\]"):
        TASK_LAYOUT.pack({("heigth" if k == "height" else k): v for k, v in parts.items()})
    with pytest.raises(DataError, match=r"'next_lines'.*\(2, 3\).*\(3, 2\)"):
        TASK_LAYOUT.pack(parts | {"next_lines": np.zeros((3, 2))})


@LAYOUTS
def test_metadata_survive_json(layout):
    assert Layout.from_metadata(json.loads(json.dumps(layout.metadata()))) == layout


def test_damaged_metadata_are_refused():
    metadata = TASK_LAYOUT.metadata()
    with pytest.raises(DataError, match="size of 34"):
        Layout.from_metadata(metadata | {"size": 34})
    with pytest.raises(DataError, match="fields"):
        Layout.from_metadata({"name": "task", "version": 1})


def test_another_layout_is_refused_by_name_and_field_but_prose_may_change():
    first, *others = TASK_LAYOUT.fields
    reworded = replace(TASK_LAYOUT, fields=(replace(first, meaning="How high."), *others))
    TASK_LAYOUT.require_equal(reworded)
    in_feet = replace(TASK_LAYOUT, fields=(replace(first, unit="ft"), *others))
    with pytest.raises(DataError, match=r"'task' version 1.*'height'"):
        TASK_LAYOUT.require_equal(in_feet)
    with pytest.raises(DataError, match="'segment' version 1"):
        TASK_LAYOUT.require_equal(SEGMENT_LAYOUT)


def test_vectors_of_another_size_or_with_nan_are_refused():
    with pytest.raises(DataError, match="264"):
        SEGMENT_LAYOUT.unpack(np.zeros((5, 35)))
    vectors = np.zeros((5, SEGMENT_LAYOUT.size))
    vectors[2:4, SEGMENT_LAYOUT.slice("RH_swing_velocity").stop - 1] = np.nan
    with pytest.raises(DataError, match=r"'RH_swing_velocity'.*2 of 5"):
        SEGMENT_LAYOUT.require_finite(vectors)


def test_unknown_and_repeated_fields_are_refused():
    with pytest.raises(DataError, match="no field 'yaw'"):
        TASK_LAYOUT.slice("yaw")
    twice = Field("a", (2,), "m", "", "c", "Twice.")
    with pytest.raises(DataError, match="unique"):
        Layout("double", 1, (twice, twice))
