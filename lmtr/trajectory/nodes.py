"""Where each quantity lies along the last axes of a trajectory's nodes.

Base nodes are (..., 2, 6): first the value or its rate, then the component. Control points of the
base have the same six components. Nodes in mid-swing are (..., 5).
"""

VALUE = 0
"""Place of a node's value."""

RATE = 1
"""Place of its time derivative."""

POSITION = slice(0, 3)
"""x, y, z (m) of the base."""

RPY = slice(3, 6)
"""Roll, pitch, yaw (rad) of the base."""

GROUND_POSITION = slice(0, 2)
"""x, y (m) of the base."""

HEIGHT = 2
"""z (m) of the base."""

TILT = slice(3, 5)
"""Roll and pitch (rad) of the base."""

YAW = 5
"""Yaw (rad) of the base."""

PLANAR = (0, 1, YAW)
"""x, y (m) and yaw (rad) of the base: its pose on the ground."""

SWING_POSITION = slice(0, 3)
"""x, y, z (m) of a foot in mid-swing."""

SWING_VELOCITY = slice(3, 5)
"""Its horizontal velocity x, y (m/s)."""
