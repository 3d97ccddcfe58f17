"""Footholds of plans beside the lines of their tasks."""

import numpy as np
import pytest

from lmtr.robot.model import FEET
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from pipelines.results.held_out import close_share


def test_a_foothold_beside_either_line_is_close():
    tasks = {field.name: np.zeros((2, *field.shape)) for field in TASK_LAYOUT.fields}
    # One line across the way at 1 m, and one along it 2 m to the left.
    tasks["next_lines"] = np.tile([[1.0, 0.0, np.pi / 2], [0.0, 2.0, 0.0]], (2, 1, 1))
    plans = {field.name: np.zeros((2, *field.shape)) for field in SEGMENT_LAYOUT.fields}
    places = [[1.04, 0.3], [0.94, 0.3], [0.5, 1.97], [0.5, 0.0]]
    for foot, (x, y) in zip(FEET, places, strict=True):
        plans[f"{foot}_second_foothold"][0] = [x, y, 0.0]
    share = close_share(SEGMENT_LAYOUT.pack(plans), TASK_LAYOUT.pack(tasks), 0.05)
    assert share == pytest.approx(2 / 8)
