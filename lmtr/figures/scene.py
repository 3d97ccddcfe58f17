"""One instant of a motion in three dimensions (Fig. 5): base, legs, forces, limits, obstacles.

The camera is orthographic, so a figure is drawn in plain 2-D axes with everything in its true
proportion; things are drawn from back to front.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D

from lmtr.arrays import Array
from lmtr.figures.style import FOOT_COLOURS, FORCE, INK, LIMIT_BOX, OBSTACLE, PYRAMID
from lmtr.geometry.rotation import rotation_matrix
from lmtr.robot.model import FEET, N_FEET, RobotModel
from lmtr.trajectory.motion import Motion

GROUND_RADIUS = 1.15
"""Radius of the disc of ground that is drawn around the robot (m)."""

GRID_STEP = 0.25
"""Spacing of the ground's grid (m)."""

ASPECT = 1.9
"""Width over height of the view."""

FORCE_LENGTH = 0.7
"""Length of the arrow of a force that equals the robot's weight (m)."""

KEY_FORCE = 100.0
"""Force (N) whose arrow length the legend gives."""

CONE_HEIGHT = 0.10
"""Height at which friction pyramids are cut off (m)."""

TRUNK = (0.95, 0.62, 0.16)
"""Half length and half width of the trunk over those of the neutral stance, half height over its
height; for the eye only, the model being one rigid body on massless legs."""

_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
_NORMALS = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])


@dataclass(frozen=True)
class Camera:
    """An orthographic camera.

    Attributes:
        azimuth: Direction from the robot to the camera about z, from x towards y (deg).
        elevation: Its angle above the ground (deg).
    """

    azimuth: float = -62.0
    elevation: float = 24.0

    @property
    def axes_W(self) -> Array:
        """Image right, image up and the direction towards the camera, as rows (3, 3)."""
        a, e = np.radians([self.azimuth, self.elevation])
        return np.array(
            [
                [-np.sin(a), np.cos(a), 0.0],
                [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)],
                [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)],
            ]
        )

    def project(self, points_W: Array) -> Array:
        """Image coordinates (..., 2) in m of points (..., 3)."""
        return np.asarray(points_W @ self.axes_W[:2].T)

    def nearness(self, points_W: Array) -> Array:
        """How far points (..., 3) lie towards the camera (m)."""
        return np.asarray(points_W @ self.axes_W[2])


@dataclass(frozen=True)
class Scene:
    """What stays the same from one instant of a motion to the next.

    Attributes:
        motion: The motion.
        obstacles_W: Lines (n, 3): x, y (m) and direction (rad).
        robot: Robot whose limits, friction and weight are drawn.
        camera: View.
        radius: Radius of the ground that is shown around the robot (m).
    """

    motion: Motion
    obstacles_W: Array
    robot: RobotModel
    camera: Camera
    radius: float = GROUND_RADIUS

    def draw(self, axes: Axes, sample: int, centre_W: Array) -> None:
        """Draw sample number ``sample`` on empty axes.

        Args:
            axes: Axes of equal aspect; their frame is taken away.
            sample: Index of the sample.
            centre_W: Point on the ground, x, y (m), in the middle of the view.
        """
        self._draw_ground(axes, centre_W)
        self._draw_trail(axes, sample, centre_W)
        self._draw_limits(axes, sample)
        self._draw_robot(axes, sample)
        self._draw_forces(axes, sample)
        middle = self.camera.project(np.array([*centre_W, 0.5 * self.robot.nominal_height]))
        width = self.radius + 0.03
        axes.set_xlim(middle[0] - width, middle[0] + width)
        axes.set_ylim(middle[1] - 0.60 * width, middle[1] + (2.0 / ASPECT - 0.60) * width)
        axes.set_aspect("equal")
        axes.set_axis_off()

    def base_rotation(self, sample: int) -> Array:
        """R, base to world, (3, 3)."""
        return np.asarray(rotation_matrix(self.motion.base_rpy[sample]))

    def hips_W(self, sample: int) -> Array:
        """Where the legs are drawn to begin, (4, 3) in m: the lower corners of the trunk."""
        return self._on_base(sample, np.sign(self.robot.nominal_feet_B) * self._trunk())

    def _trunk(self) -> Array:
        """Half sides of the trunk (3,) in m."""
        robot = self.robot
        stance = (robot.nominal_forward, robot.nominal_lateral, robot.nominal_height)
        return np.asarray(np.array(TRUNK) * np.array(stance))

    def _on_base(self, sample: int, points_B: Array) -> Array:
        return np.asarray(
            self.motion.base_position_W[sample] + points_B @ self.base_rotation(sample).T
        )

    def _draw_ground(self, axes: Axes, centre_W: Array) -> None:
        angles = np.linspace(0.0, 2.0 * np.pi, 90)
        rim = centre_W + self.radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        axes.fill(*self.camera.project(on_ground(rim)).T, color="#F6F6F4", zorder=0.0)
        low = np.ceil((centre_W - self.radius) / GRID_STEP) * GRID_STEP
        steps = GRID_STEP * np.arange(int(2.0 * self.radius / GRID_STEP) + 1)
        grid = [(low[0] + s, centre_W[1], np.pi / 2.0) for s in steps]
        grid += [(centre_W[0], low[1] + s, 0.0) for s in steps]
        self._draw_lines(axes, np.array(grid), centre_W, "#DEDEDA", 0.6, 0.1)
        self._draw_lines(axes, np.asarray(self.obstacles_W), centre_W, OBSTACLE, 4.0, 0.2)

    def _draw_lines(
        self, axes: Axes, lines: Array, centre_W: Array, colour: str, width: float, zorder: float
    ) -> None:
        visible = self.camera.project(on_ground(chords(lines, centre_W, self.radius)))
        axes.add_collection(
            LineCollection(list(visible), colors=colour, linewidths=width, zorder=zorder)
        )

    def _draw_trail(self, axes: Axes, sample: int, centre_W: Array) -> None:
        """Shadow of the trunk, the base's path on the ground, and footholds up to now."""
        motion = self.motion
        shadow = self._on_base(sample, _CORNERS[[0, 2, 6, 4]] * self._trunk())[:, :2]
        axes.fill(
            *self.camera.project(on_ground(shadow)).T, color="#000000", alpha=0.10, lw=0, zorder=0.3
        )
        path = motion.base_position_W[: sample + 1, :2]
        path = path[np.linalg.norm(path - centre_W, axis=-1) < self.radius]
        axes.plot(*self.camera.project(on_ground(path)).T, ":", color=INK, lw=1.2, zorder=0.4)
        feet = motion.footholds
        near = np.linalg.norm(feet.position_W - centre_W, axis=-1) < self.radius
        shown = near & (feet.touchdown <= motion.times[sample])
        places = self.camera.project(on_ground(feet.position_W[shown]))
        colours = [FOOT_COLOURS[FEET[foot]] for foot in feet.foot[shown]]
        axes.scatter(
            places[:, 0], places[:, 1], marker="x", s=30, linewidths=1.6, c=colours, zorder=0.5
        )

    def _draw_limits(self, axes: Axes, sample: int) -> None:
        """The boxes that the expert keeps the feet in, and friction pyramids under loaded feet."""
        sides = np.array(self.robot.range_of_motion)
        for neutral in self.robot.nominal_feet_B:
            corners = self.camera.project(self._on_base(sample, neutral + _CORNERS * sides))
            axes.add_collection(
                PolyCollection(
                    [corners[list(face)] for face in _FACES],
                    facecolors=(*_rgb(LIMIT_BOX), 0.06),
                    edgecolors=(*_rgb(LIMIT_BOX), 0.55),
                    linewidths=0.7,
                    zorder=0.6,
                )
            )
        spread = self.robot.friction * CONE_HEIGHT
        rim = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * spread
        for foot in np.flatnonzero(self.motion.contact[sample]):
            tip = self.motion.foot_position_W[sample, foot]
            edge = tip + np.column_stack([rim, np.full(4, CONE_HEIGHT)])
            sides_W = [np.stack([tip, edge[k], edge[(k + 1) % 4]]) for k in range(4)]
            axes.add_collection(
                PolyCollection(
                    [self.camera.project(side) for side in sides_W],
                    facecolors=(*_rgb(FORCE), 0.07),
                    edgecolors=(*_rgb(FORCE), 0.30),
                    linewidths=0.5,
                    zorder=0.7,
                )
            )

    def _draw_robot(self, axes: Axes, sample: int) -> None:
        """Legs on the far side, trunk, legs on the near side."""
        hips, feet = self.hips_W(sample), self.motion.foot_position_W[sample]
        middle = float(self.camera.nearness(self.motion.base_position_W[sample]))
        for foot in range(N_FEET):
            zorder = 1.0 if float(self.camera.nearness(hips[foot])) < middle else 3.0
            leg = self.camera.project(np.stack([hips[foot], feet[foot]]))
            colour = FOOT_COLOURS[FEET[foot]]
            axes.plot(*leg.T, color=INK, lw=4.6, solid_capstyle="round", zorder=zorder)
            axes.plot(*leg.T, color=colour, lw=3.0, solid_capstyle="round", zorder=zorder)
            stands = bool(self.motion.contact[sample, foot])
            axes.plot(
                *leg[1],
                "o",
                markersize=8,
                markerfacecolor=colour if stands else "white",
                markeredgecolor=INK,
                zorder=zorder + 0.1,
            )
        corners = self._on_base(sample, _CORNERS * self._trunk())
        facing = self.camera.nearness(_NORMALS @ self.base_rotation(sample).T)
        seen = [k for k in range(len(_FACES)) if facing[k] > 0.0]
        axes.add_collection(
            PolyCollection(
                [self.camera.project(corners[list(_FACES[k])]) for k in seen],
                facecolors=[str(0.55 + 0.35 * float(facing[k])) for k in seen],
                edgecolors=INK,
                linewidths=1.0,
                zorder=2.0,
            )
        )
        self._draw_heading(axes, sample)

    def _draw_heading(self, axes: Axes, sample: int) -> None:
        """A dark triangle on the trunk that points forward."""
        arrow = np.array([[0.85, 0.0, 1.0], [0.45, 0.5, 1.0], [0.45, -0.5, 1.0]]) * self._trunk()
        axes.fill(*self.camera.project(self._on_base(sample, arrow)).T, color=INK, lw=0, zorder=2.1)

    def _draw_forces(self, axes: Axes, sample: int) -> None:
        forces = self.motion.foot_force_W[sample] / self.robot.weight * FORCE_LENGTH
        for foot in np.flatnonzero(np.linalg.norm(forces, axis=-1) > 0.01):
            tail = self.motion.foot_position_W[sample, foot]
            start, end = self.camera.project(np.stack([tail, tail + forces[foot]]))
            axes.annotate(
                "",
                xy=end,
                xytext=start,
                arrowprops={
                    "arrowstyle": "-|>,head_width=0.22,head_length=0.4",
                    "color": FORCE,
                    "lw": 2.2,
                    "shrinkA": 0,
                    "shrinkB": 0,
                },
                zorder=4.0,
            )


def scene_key(robot: RobotModel) -> list[Line2D]:
    """Legend entries of a scene; that of the forces gives their scale."""
    centimetres = 100.0 * FORCE_LENGTH * KEY_FORCE / robot.weight
    entries = (
        (f"ground reaction, {KEY_FORCE:.0f} N = {centimetres:.0f} cm", FORCE, 2.2, ""),
        (f"friction pyramid, μ = {robot.friction:g}", PYRAMID, 1.2, ""),
        ("range of motion", LIMIT_BOX, 1.2, ""),
        ("obstacle line", OBSTACLE, 4.0, ""),
        ("foothold", INK, 0.0, "x"),
        (f"ground grid, {GRID_STEP:g} m", "#C9C9C4", 1.0, ""),
        *((f"{foot} leg", colour, 3.0, "") for foot, colour in FOOT_COLOURS.items()),
    )
    return [
        Line2D([], [], color=colour, linewidth=width, marker=marker, label=label)
        for label, colour, width, marker in entries
    ]


def sample_at(motion: Motion, time: float) -> int:
    """Index of the sample nearest to ``time`` (s)."""
    return int(np.abs(motion.times - time).argmin())


def on_ground(points: Array) -> Array:
    """Points (..., 2) in m with z = 0, (..., 3)."""
    return np.concatenate([points, np.zeros((*points.shape[:-1], 1))], axis=-1)


def chords(lines: Array, centre: Array, radius: float) -> Array:
    """The parts of ground-plane lines (n, 3) inside a disc: end points (m, 2, 2) in m, m ≤ n."""
    lines = lines.reshape(-1, 3)
    direction = np.stack([np.cos(lines[:, 2]), np.sin(lines[:, 2])], axis=-1)
    along = ((centre - lines[:, :2]) * direction).sum(axis=-1, keepdims=True)
    nearest = lines[:, :2] + along * direction
    half = radius**2 - ((nearest - centre) ** 2).sum(axis=-1)
    met = half > 0.0
    reach = np.sqrt(half[met])[:, None] * direction[met]
    return np.stack([nearest[met] - reach, nearest[met] + reach], axis=1)


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue
