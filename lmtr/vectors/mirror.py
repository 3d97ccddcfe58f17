"""Left-right mirror of task and segment vectors: an exact symmetry, used as augmentation.

The mirror plane is the x-z plane of the segment frame: y changes its sign, left and right feet
swap, and of axial quantities (roll, yaw and the angular velocity about x and z) the signs change.
The robot's mass distribution is nearly symmetric too; its products of inertia Ixy and Iyz are not,
by less than a thousandth of its moments.
"""

import numpy as np

from lmtr.arrays import Array
from lmtr.robot.model import FEET
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT, Layout

_OPPOSITE = {"LF": "RF", "RF": "LF", "LH": "RH", "RH": "LH"}
_POLAR = np.array([1.0, -1.0, 1.0])
_AXIAL = np.array([-1.0, 1.0, -1.0])
_NONE = np.array(1.0)

# By field, or by the field's name after its foot: a sign for each number of the last axis.
_SIGNS = {
    "height": _NONE,
    "roll_pitch": _AXIAL[:2],
    "linear_velocity": _POLAR,
    "angular_velocity": _AXIAL,
    "position": _POLAR,
    "time_since_liftoff": _NONE,
    "next_lines": _POLAR,
    "goal_position": _POLAR[:2],
    "goal_heading": np.array([1.0, -1.0]),
    "base_nodes": np.concatenate([_POLAR, _AXIAL]),
    "times": _NONE,
    "first_foothold": _POLAR,
    "swing_position": _POLAR,
    "swing_velocity": _POLAR[:2],
    "second_foothold": _POLAR,
    "forces": _POLAR,
}


def mirror_task(x: Array) -> Array:
    """The task vectors (..., 35) of the mirrored robot, goal and obstacles."""
    return TASK_LAYOUT.pack(_mirror_parts(TASK_LAYOUT, x))


def mirror_segment(tau: Array) -> Array:
    """The segment vectors (..., 264) of the mirrored motion."""
    return SEGMENT_LAYOUT.pack(_mirror_parts(SEGMENT_LAYOUT, tau))


def _mirror_parts(layout: Layout, vectors: Array) -> dict[str, Array]:
    parts = layout.unpack(np.asarray(vectors, dtype=np.float64))
    mirrored: dict[str, Array] = {}
    for name in parts:
        foot, _, quantity = name.partition("_")
        source, kind = (f"{_OPPOSITE[foot]}_{quantity}", quantity) if foot in FEET else (name, name)
        mirrored[name] = parts[source] * _SIGNS[kind]
    if "next_lines" in mirrored:
        # The point of a canonical line mirrors to the point of the mirrored one; its direction
        # turns from α to π − α, brought back into [0, π).
        direction = np.pi - parts["next_lines"][..., 2]
        mirrored["next_lines"][..., 2] = np.where(direction >= np.pi, 0.0, direction)
    return mirrored
