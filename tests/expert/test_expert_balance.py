"""Solutions of whole tasks, rebuilt by SciPy: they balance, keep the rules, cost what they say.

Nothing here samples a trajectory with the project's own code.
"""

from functools import cached_property

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from lmtr.expert.constraints.dynamics import LEVER_ARM
from lmtr.expert.solver import EARLY_CONSTRAINT_TOLERANCE
from lmtr.quality.filter import QualityThresholds
from lmtr.robot.model import ANYMAL, GRAVITY, N_FEET
from lmtr.trajectory.trajectory import BASE_STEP

STEP = 1e-5
PROMISED = EARLY_CONSTRAINT_TOLERANCE * ANYMAL.weight
"""What the solver may leave of any component of the balance of forces (N)."""

LIMITS = QualityThresholds()


class Rebuilt:
    """Splines of one solution in time, feet and forces each as one spline from start to end."""

    def __init__(self, trajectory):
        times = trajectory.contact_times
        self.begin, self.end = times[:, 0::2], times[:, 1::2]
        nodes = trajectory.base_nodes
        self.knots = BASE_STEP * np.arange(len(nodes))
        self.base = CubicHermiteSpline(self.knots, nodes[:, 0], nodes[:, 1])
        self.feet = [self._foot(trajectory, foot) for foot in range(N_FEET)]
        self.forces = [self._force(trajectory, foot) for foot in range(N_FEET)]
        self.footholds = trajectory.footholds

    def _foot(self, trajectory, foot):
        """A stance is a piece between two nodes at rest, a swing two pieces about its middle."""
        stops = np.repeat(trajectory.footholds[foot], 2, axis=0)
        swings, velocity = trajectory.swing_nodes[foot], np.zeros((len(stops), 3))
        middle = np.arange(2, len(stops), 2)
        times = np.sort(np.stack([self.begin[foot], self.end[foot]], axis=-1).reshape(-1))
        half_way = 0.5 * (times[1:-1:2] + times[2::2])
        drift = np.pad(swings[:, 3:], ((0, 0), (0, 1)))
        return CubicHermiteSpline(
            np.insert(times, middle, half_way),
            np.insert(stops, middle, swings[:, :3], axis=0),
            np.insert(velocity, middle, drift, axis=0),
        )

    def _force(self, trajectory, foot):
        """In swing it runs from a stance's last node to the next one's first."""
        nodes = trajectory.force_nodes[foot]
        share = np.linspace(0.0, 1.0, nodes.shape[1])
        begin, end = self.begin[foot][:, None], self.end[foot][:, None]
        flat = nodes.reshape(-1, 2, 3)
        times = (begin + share * (end - begin)).reshape(-1)
        return CubicHermiteSpline(times, flat[:, 0], flat[:, 1])

    def rotation(self, times):
        return Rotation.from_euler("ZYX", self.base(times)[:, :2:-1]).as_matrix()

    def momentum(self, times):
        """Angular momentum about the centre of mass, world axes; ω from differences of R."""
        rotation = self.rotation(times)
        slope = (self.rotation(times + STEP) - self.rotation(times - STEP)) / (2.0 * STEP)
        spin = slope @ rotation.transpose(0, 2, 1)
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
        inertia_W = rotation @ ANYMAL.inertia_B @ rotation.transpose(0, 2, 1)
        return np.einsum("tij,tj->ti", inertia_W, omega)

    def at(self, splines, times):
        """Values of all feet's splines, (M, 4, 3)."""
        return np.stack([spline(times) for spline in splines], axis=1)

    @cached_property
    def grid(self):
        return np.arange(0.0, self.knots[-1] + 1e-9, 0.01)

    @cached_property
    def stance(self):
        """Stance of each foot on the grid, (M, 4), −1 in swing."""
        inside = (self.begin <= self.grid[:, None, None]) & (self.grid[:, None, None] <= self.end)
        return np.where(inside.any(axis=-1), inside.argmax(axis=-1), -1)


@pytest.fixture(scope="module", params=range(3))
def case(request, solved_tasks):
    return solved_tasks[request.param]


@pytest.fixture(scope="module")
def rebuilt(case):
    return Rebuilt(case.solution.trajectory)


def means_around_nodes(values):
    """Means of what is sampled every half knot, weighted with each inner node's hat function."""
    return (values[1:-2:2] + values[2:-1:2] + values[3::2]) / 3.0


@pytest.fixture(scope="module")
def halves(rebuilt):
    """Base nodes and the points half-way, off the very ends so that differences have room."""
    times = 0.5 * BASE_STEP * np.arange(2 * len(rebuilt.knots) - 1)
    return np.clip(times, 2.0 * STEP, times[-1] - 2.0 * STEP)


def missing_force(rebuilt, times):
    """Force that the base's acceleration needs and the feet do not give, (M, 3) in N."""
    gravity = np.array([0.0, 0.0, -ANYMAL.weight])
    force = rebuilt.at(rebuilt.forces, times).sum(axis=1) + gravity
    return ANYMAL.mass * rebuilt.base(times, 2)[:, :3] - force


def test_forces_explain_the_mean_acceleration_around_every_base_node(rebuilt, halves):
    missing = means_around_nodes(missing_force(rebuilt, halves))
    assert np.abs(missing).max() < PROMISED
    needed = ANYMAL.mass * rebuilt.base(rebuilt.knots, 2)[:, :3]
    assert np.abs(needed).max() > 50.0 * PROMISED


def test_moments_explain_the_mean_change_of_spin_around_every_base_node(rebuilt, halves, case):
    position = rebuilt.base(halves)[:, None, :3]
    arm = rebuilt.at(rebuilt.feet, halves) - position
    moment = np.cross(arm, rebuilt.at(rebuilt.forces, halves)).sum(axis=1)
    change = (rebuilt.momentum(halves + STEP) - rebuilt.momentum(halves - STEP)) / (2.0 * STEP)
    # The solver balances moments about the guessed base; about the true one, what is missing of
    # forces between the nodes has a lever arm of its own.
    nodes = case.solution.guess.base_nodes
    guessed = CubicHermiteSpline(rebuilt.knots, nodes[:, 0], nodes[:, 1])(halves)[:, :3]
    shift = np.cross(position[:, 0] - guessed, missing_force(rebuilt, halves))
    missing = means_around_nodes(change - moment + shift)
    assert np.abs(missing).max() < PROMISED * LEVER_ARM * 1.01
    assert np.abs(means_around_nodes(shift)).max() < 0.05 * np.abs(moment).max()
    assert np.abs(moment).max() > 30.0 * PROMISED * LEVER_ARM


def test_the_base_accelerates_without_jumps(rebuilt):
    knots = rebuilt.knots[1:-1]
    before, after = rebuilt.base(knots - 1e-9, 2), rebuilt.base(knots + 1e-9, 2)
    np.testing.assert_allclose(before, after, atol=1e-5)
    assert np.abs(after).max() > 0.1 * GRAVITY


def test_swinging_feet_push_nothing_and_standing_ones_hold_still_on_the_ground(rebuilt):
    feet, force = (rebuilt.at(splines, rebuilt.grid) for splines in (rebuilt.feet, rebuilt.forces))
    stands = rebuilt.stance >= 0
    assert 0.1 < (~stands).mean() < 0.5
    np.testing.assert_array_equal(force[~stands], 0.0)
    holds = rebuilt.footholds[np.arange(N_FEET), rebuilt.stance]
    np.testing.assert_allclose(feet[stands], holds[stands], atol=1e-12)
    np.testing.assert_allclose(feet[stands][:, 2], 0.0, atol=1e-12)
    assert feet[~stands][:, 2].min() > -LIMITS.swing_depth
    assert feet[..., 2].max(axis=0).min() > 0.04 - 1e-6


def test_forces_push_within_the_friction_pyramid_and_bear_the_weight(rebuilt):
    force = rebuilt.at(rebuilt.forces, rebuilt.grid) / ANYMAL.weight
    tangential = np.abs(force[..., :2]).max(axis=-1)
    assert (tangential - ANYMAL.friction * force[..., 2]).max() < LIMITS.friction_excess
    assert force[..., 2].min() > -LIMITS.pull
    assert force[..., 2].max() < LIMITS.force_peak + 1e-6
    assert force[..., 2].sum(axis=1).mean() == pytest.approx(1.0, abs=0.01)


def test_feet_stay_within_their_range_of_motion(rebuilt):
    arm = rebuilt.at(rebuilt.feet, rebuilt.grid) - rebuilt.base(rebuilt.grid)[:, None, :3]
    offset_B = arm @ rebuilt.rotation(rebuilt.grid) - ANYMAL.nominal_feet_B
    excess = np.abs(offset_B) - np.array(ANYMAL.range_of_motion)
    stands = rebuilt.stance >= 0
    assert excess[stands].max() < LIMITS.stance_overshoot
    assert excess[~stands][:, :2].max() < LIMITS.swing_overshoot


def offsets_in_half_sides(rebuilt):
    """Offsets of the feet from neutral at the nodes after the start, in half sides of the box."""
    times = rebuilt.knots[1:]
    arm = rebuilt.at(rebuilt.feet, times) - rebuilt.base(times)[:, None, :3]
    offset_B = arm @ rebuilt.rotation(times) - ANYMAL.nominal_feet_B
    return offset_B / np.array(ANYMAL.range_of_motion)


def potentials(footholds, lines):
    """exp(−d²/2σ²) of footholds (n, 2) at distances d from lines (x, y, angle)."""
    x, y, angle = lines.T
    across = (footholds[:, :1] - x) * np.sin(angle) - (footholds[:, 1:] - y) * np.cos(angle)
    return np.exp(-(across**2) / (2.0 * 0.08**2))


def swing_offsets(trajectory):
    """Middles of swings off the point half-way and raised by 0.08 m, and their drift, in m."""
    feet, times = trajectory.footholds, trajectory.contact_times
    offset = trajectory.swing_nodes[..., :3] - 0.5 * (feet[:, 1:] + feet[:, :-1])
    duration = (times[:, 2::2] - times[:, 1:-1:2])[..., None]
    drift = trajectory.swing_nodes[..., 3:] * duration - 1.5 * np.diff(feet, axis=1)[..., :2]
    return offset - np.array([0.0, 0.0, 0.08]), drift


def free_force_points(trajectory):
    """Bézier points of the forces that are free to choose, in weights, (n, 3)."""
    nodes = trajectory.force_nodes / ANYMAL.weight
    times = trajectory.contact_times
    third = (times[:, 1::2] - times[:, 0::2])[..., None] / 6.0
    middle, first, last = nodes[:, :, 1], nodes[:, 0, 0], nodes[:, -1, 2]
    points = [
        middle[..., 0, :] - third * middle[..., 1, :],
        middle[..., 0, :] + third * middle[..., 1, :],
        first[:, 0],
        first[:, 0] + third[:, 0] * first[:, 1],
        last[:, 0],
        last[:, 0] - third[:, -1] * last[:, 1],
    ]
    return np.concatenate([part.reshape(-1, 3) for part in points])


def force_roughness(rebuilt, order):
    """∫₀¹ |dⁿf/duⁿ|² du of all force cubics over their own unit times, in weights squared."""
    at, weights = np.polynomial.legendre.leggauss(4)
    half = (rebuilt.end - rebuilt.begin)[..., None] / 2.0
    begin = rebuilt.begin[..., None] + half * np.arange(2)
    times = begin[..., None] + half[..., None] * (at + 1.0) / 2.0
    derivative = (
        np.stack([rebuilt.forces[foot](times[foot], order) for foot in range(N_FEET)])
        * half[..., None, None] ** order
    )
    return ((derivative / ANYMAL.weight) ** 2).sum(axis=-1) @ (weights / 2.0)


def test_each_cost_is_what_its_name_says(rebuilt, case):
    trajectory, told = case.solution.trajectory, case.solution.cost_terms
    base, second = rebuilt.base(rebuilt.knots), rebuilt.base(rebuilt.knots, 2)
    offset, drift = swing_offsets(trajectory)
    feet = trajectory.footholds[:, 1:, :2].reshape(-1, 2)
    expected = {
        "acceleration": 0.02 * 0.1 * (second[:, :3] ** 2).sum(),
        "angular_acceleration": 0.01 * 0.1 * (second[:, 3:] ** 2).sum(),
        "tilt": 0.4 * 0.1 * (base[:, 3:5] ** 2).sum(),
        "height": 2.5 * 0.1 * ((base[:, 2] - 0.42) ** 2).sum(),
        "foot_offset": 0.03 * 0.1 * (offsets_in_half_sides(rebuilt) ** 2).sum(),
        "horizontal_force": 0.02 * (free_force_points(trajectory)[:, :2] ** 2).sum(),
        "force_slope": 0.02 * force_roughness(rebuilt, 1).sum(),
        "force_curvature": 0.004 * force_roughness(rebuilt, 2).sum(),
        "swing_offset": (offset**2).sum(),
        "swing_drift": (drift**2).sum(),
        "obstacles": 1.0 * potentials(feet, case.task.obstacles_W).sum(),
    }
    assert told == pytest.approx(expected, rel=1e-7)
    assert case.solution.cost == pytest.approx(sum(expected.values()), rel=1e-7)
