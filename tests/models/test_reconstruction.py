"""Physical errors of known offsets."""

import numpy as np
import pytest

from lmtr.models.reconstruction import reconstruction_errors
from lmtr.robot.model import FEET
from lmtr.vectors.layout import SEGMENT_LAYOUT


@pytest.mark.parametrize(
    ("field", "offset", "error", "expected"),
    [
        ("base_nodes", [[0.003, 0.0, 0.004, 9.0, 9.0, 9.0], [9.0] * 6], "base_position_mm", 5.0),
        ("LF_times", 0.02, "times_ms", 5.0),
        ("RH_second_foothold", [0.0, 0.012, 0.016], "second_foothold_mm", 5.0),
        ("LH_forces", [[30.0] * 3, [777.0] * 3], "forces_weights", 0.025),
    ],
)
def test_a_known_offset_of_one_foot_or_the_base_gives_a_known_error(field, offset, error, expected):
    tau = np.random.default_rng(0).standard_normal((6, SEGMENT_LAYOUT.size))
    parts = {name: part.copy() for name, part in SEGMENT_LAYOUT.unpack(tau).items()}
    parts[field] = parts[field] + np.array(offset)
    errors = reconstruction_errors(tau, SEGMENT_LAYOUT.pack(parts), weight=300.0).model_dump()
    assert errors.pop(error) == pytest.approx(expected)
    errors.pop("epoch_feet_mm")  # follows from several fields
    assert list(errors.values()) == pytest.approx([0.0] * 3)


def test_feet_that_stand_at_the_epoch_are_as_far_off_as_their_first_footholds(walk_segments):
    tau = walk_segments.tau[:50]
    parts = {name: part.copy() for name, part in SEGMENT_LAYOUT.unpack(tau).items()}
    for foot in FEET:
        parts[f"{foot}_times"] = parts[f"{foot}_times"] - parts[f"{foot}_times"][:, :1] - 0.01
    standing = SEGMENT_LAYOUT.pack(parts)
    parts["RF_first_foothold"] += np.array([0.03, 0.04, 0.0])
    errors = reconstruction_errors(standing, SEGMENT_LAYOUT.pack(parts), weight=300.0)
    assert errors.epoch_feet_mm == pytest.approx(50.0 / 4)
