"""What modes are coloured by is what sampling the segments finds."""

import numpy as np

from lmtr.figures.mode_properties import segment_properties
from lmtr.robot.model import FEET
from lmtr.trajectory.sample import sample_base, sample_feet
from lmtr.vectors.layout import SEGMENT_DURATION
from lmtr.vectors.segment_vector import decode_segment


def test_properties_are_those_of_the_sampled_motion(walk_segments):
    segments = decode_segment(walk_segments.tau)
    found = {each.label: each.values for each in segment_properties(segments)}
    count = len(walk_segments.tau)
    ends = np.broadcast_to([0.0, SEGMENT_DURATION], (count, 2))
    base = sample_base(segments, ends)
    np.testing.assert_allclose(
        np.radians(found["change of yaw (deg)"]), base.rpy[:, 1, 2] - base.rpy[:, 0, 2], atol=1e-9
    )
    climb = base.position[:, 1, 2] - base.position[:, 0, 2]
    np.testing.assert_allclose(found["change of height (mm)"], 1e3 * climb, atol=1e-6)
    for foot in ("LF", "RF"):
        place = FEET.index(foot)
        liftoff = segments.liftoff_times[:, place, :1] - 1e-6
        touchdown = segments.touchdown_times[:, place, -1:]
        stood = sample_feet(segments, np.hstack([liftoff, touchdown])).position[:, :, place]
        stride = np.linalg.norm(stood[:, 1] - stood[:, 0], axis=-1)
        np.testing.assert_allclose(found[f"stride of {foot} (m)"], stride, atol=1e-3)
    first = found["foot that lifts first"]
    own = segments.liftoff_times[np.arange(count), first, 0]
    np.testing.assert_array_equal(own, segments.liftoff_times[:, :, 0].min(axis=1))
    assert len(np.unique(first)) > 1
