"""Figures of motions show what the motion says."""

import dataclasses

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from PIL import Image

from lmtr.errors import ConfigurationError, DataError
from lmtr.figures.gait_diagram import draw_gait
from lmtr.figures.motion_figure import motion_figure
from lmtr.figures.resample import resampled
from lmtr.figures.scene import Camera, chords
from lmtr.figures.snapshots import snapshots
from lmtr.figures.style import (
    FOOT_COLOURS,
    FULL_WIDTH,
    RESOLUTION,
    save,
    series_styles,
    styles_for,
)
from lmtr.figures.top_view import draw_top_view, ground_window
from lmtr.geometry.line import signed_distance
from lmtr.robot.model import ANYMAL, FEET, N_FEET
from lmtr.trajectory.motion import Footholds, Motion

LINES_W = np.array([[0.4, 0.0, 1.4], [0.9, 0.1, 1.8]])


def trot(duration=2.0, dt=0.05, speed=0.5):
    """A level trot at constant speed with known contacts: diagonal pairs swing in turn."""
    times = dt * np.arange(round(duration / dt) + 1)
    base = np.stack([speed * times, 0.0 * times, np.full_like(times, 0.42)], axis=-1)
    period, swing = 0.8, 0.3
    foot, position, touchdown, liftoff = [], [], [], []
    contact = np.ones((len(times), N_FEET), dtype=bool)
    for k in range(N_FEET):
        lifts = np.arange(0.2 if k in (0, 3) else 0.6, duration - swing, period)
        begins = np.concatenate([[0.0], lifts + swing])
        ends = np.concatenate([lifts, [duration]])
        for begin, end in zip(begins, ends, strict=True):
            foot.append(k)
            middle = 0.5 * (begin + end)
            position.append(ANYMAL.nominal_feet_B[k, :2] + [speed * middle, 0.0])
            touchdown.append(begin)
            liftoff.append(end)
        for lift in lifts:
            contact[(times >= lift) & (times < lift + swing), k] = False
    feet = base[:, None, :] + ANYMAL.nominal_feet_B
    force = np.zeros((len(times), N_FEET, 3))
    force[..., 2] = contact * ANYMAL.weight / contact.sum(axis=1, keepdims=True)
    return Motion(
        times=times,
        base_position_W=base,
        base_rpy=np.zeros_like(base),
        base_velocity_W=np.tile([speed, 0.0, 0.0], (len(times), 1)),
        base_angular_velocity_W=np.zeros_like(base),
        foot_position_W=feet,
        foot_force_W=force,
        contact=contact,
        footholds=Footholds(
            foot=np.array(foot),
            position_W=np.array(position),
            touchdown=np.array(touchdown),
            liftoff=np.array(liftoff),
        ),
    )


def drawn_top_view(motion, **kwargs):
    axes = Figure().subplots()
    draw_top_view(axes, motion, LINES_W, **kwargs)
    return axes


def test_each_foothold_is_one_cross_in_the_colour_of_its_foot():
    motion = trot()
    axes = drawn_top_view(motion)
    crosses = {
        c.get_label().removesuffix(" foothold"): c
        for c in axes.collections
        if isinstance(c, PathCollection)
    }
    assert set(crosses) == set(FEET)
    for k, foot in enumerate(FEET):
        mine = motion.footholds.position_W[motion.footholds.foot == k]
        np.testing.assert_allclose(crosses[foot].get_offsets(), mine)
        red, green, blue, _ = crosses[foot].get_facecolor()[0]
        spelt = "#" + "".join(f"{round(255 * part):02X}" for part in (red, green, blue))
        assert spelt == FOOT_COLOURS[foot]


@pytest.mark.parametrize("dt", [0.02, 0.05, 0.1, 0.25])
def test_base_dots_lie_a_tenth_of_a_second_apart_whatever_the_sampling(dt):
    axes = drawn_top_view(trot(dt=dt, speed=0.5))
    (dots,) = (line for line in axes.lines if line.get_label().startswith("base"))
    np.testing.assert_allclose(np.diff(dots.get_xdata()), 0.05, atol=1e-12)
    assert len(dots.get_xdata()) == 21


def test_top_view_is_to_scale_labelled_in_metres_and_shows_everything():
    motion = trot()
    goal = np.array([3.0, -0.5, 0.3])
    axes = drawn_top_view(motion, goal_pose_W=goal)
    assert axes.get_aspect() == 1.0
    assert axes.get_xlabel() == "x (m)"
    assert axes.get_ylabel() == "y (m)"
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    shown = np.concatenate([motion.footholds.position_W, motion.base_position_W[:, :2], [goal[:2]]])
    assert (shown > [left, bottom]).all()
    assert (shown < [right, top]).all()


def test_obstacles_lie_on_their_lines():
    axes = drawn_top_view(trot())
    drawn = [line for line in axes.lines if line.get_label() == "obstacle line"]
    assert len(drawn) == len(LINES_W)
    for line, artist in zip(LINES_W, drawn, strict=True):
        through = np.array([artist.get_xy1(), artist.get_xy2()])
        np.testing.assert_allclose(signed_distance(line, through), 0.0, atol=1e-12)


def test_shaded_potential_is_that_of_the_nearest_line():
    motion, width = trot(), 0.1
    (shade,) = drawn_top_view(motion, potential_width=width).images
    window, values = ground_window(motion), np.asarray(shade.get_array())
    rows, columns = values.shape
    row, column = rows // 3, columns // 2
    point = np.array(
        [
            window.left + (column + 0.5) / columns * window.width,
            window.bottom + (row + 0.5) / rows * window.height,
        ]
    )
    nearest = np.abs(signed_distance(LINES_W, point)).min()
    assert values[row, column] == pytest.approx(np.exp(-0.5 * (nearest / width) ** 2))


def test_bars_of_the_gait_diagram_are_the_phases():
    motion = trot()
    axes = Figure().subplots()
    draw_gait(axes, motion)
    bars = {c.get_label(): [p.get_extents() for p in c.get_paths()] for c in axes.collections}
    for k, foot in enumerate(FEET):
        mine = motion.footholds.foot == k
        stance = [box.width for box in bars[f"{foot} stance"]]
        swing = [box.width for box in bars[f"{foot} swing"]]
        expected = motion.footholds.liftoff[mine] - motion.footholds.touchdown[mine]
        np.testing.assert_allclose(stance, expected)
        np.testing.assert_allclose(swing, 0.3)
        assert sum(stance) + sum(swing) == pytest.approx(motion.times[-1])
    assert [label.get_text() for label in axes.get_yticklabels()] == list(FEET)
    assert axes.yaxis_inverted()  # the first foot is on top


def cut_short(motion, end):
    """The motion until ``end`` (s) as a rollout records it: what comes after is unknown."""
    kept = motion.times <= end + 1e-9
    samples = {name: array[kept] for name, array in vars(motion).items() if name != "footholds"}
    begun = motion.footholds.touchdown <= end
    footholds = Footholds(**{name: array[begun] for name, array in vars(motion.footholds).items()})
    until = np.minimum(footholds.liftoff, end)
    return Motion(**samples, footholds=dataclasses.replace(footholds, liftoff=until))


def test_a_swing_that_the_end_cuts_short_is_a_box_until_then():
    motion = cut_short(trot(), 1.15)  # the first and the last foot have swung since 1.0 s
    axes = Figure().subplots()
    draw_gait(axes, motion)
    bars = {c.get_label(): [p.get_extents() for p in c.get_paths()] for c in axes.collections}
    for k, foot in enumerate(FEET):
        last = max(bars[f"{foot} swing"], key=lambda box: box.x1)
        expected = (1.0, 1.15) if k in (0, 3) else (0.6, 0.9)
        np.testing.assert_allclose((last.x0, last.x1), expected)
        widths = [box.width for phase in ("stance", "swing") for box in bars[f"{foot} {phase}"]]
        assert sum(widths) == pytest.approx(1.15)


def test_footholds_in_any_order_give_the_same_gait_diagram():
    motion = trot()
    back = Footholds(**{k: v[::-1] for k, v in vars(motion.footholds).items()})
    pictures = []
    for footholds in (motion.footholds, back):
        figure = Figure(dpi=40)
        draw_gait(figure.subplots(), dataclasses.replace(motion, footholds=footholds))
        figure.canvas.draw()
        pictures.append(
            [p.get_extents().bounds for c in figure.axes[0].collections for p in c.get_paths()]
        )
    np.testing.assert_allclose(*pictures)


def test_saved_figure_has_its_size_in_pixels(tmp_path):
    figure = motion_figure(trot(), LINES_W, "Trot", potential_width=0.1, with_state=True)
    path = save(figure, tmp_path / "trot.png")
    with Image.open(path) as image:
        assert image.size[0] == round(FULL_WIDTH * RESOLUTION)
        assert len(image.convert("RGB").getcolors(1 << 20)) > 20
    assert len(figure.axes) == 5
    assert figure.axes[-1].get_xlabel() == "time (s)"
    assert all(axes.get_ylabel() for axes in figure.axes)


def test_drawing_leaves_the_global_style_alone():
    import matplotlib

    before = dict(matplotlib.rcParams)
    motion_figure(trot(), LINES_W, "Trot")
    assert dict(matplotlib.rcParams) == before


def test_motion_that_cannot_be_drawn_is_refused():
    motion = trot()
    short = dataclasses.replace(motion, times=motion.times[:1])
    with pytest.raises(DataError, match="two samples, got 1"):
        motion_figure(short, LINES_W, "x")
    broken = dataclasses.replace(motion, base_rpy=np.full_like(motion.base_rpy, np.nan))
    with pytest.raises(DataError, match="finite"):
        motion_figure(broken, LINES_W, "x")


def test_snapshots_show_the_nearest_samples_in_one_panel_each():
    figure = snapshots(trot(dt=0.05), LINES_W, ANYMAL, [0.31, 0.9, 1.52, 1.8], "Trot")
    texts = [text.get_text() for axes in figure.axes for text in axes.texts if text.get_text()]
    assert texts == ["t = 0.30 s", "t = 0.90 s", "t = 1.50 s", "t = 1.80 s"]
    with pytest.raises(ConfigurationError, match="at least one time"):
        snapshots(trot(), LINES_W, ANYMAL, [])


def test_camera_axes_are_orthonormal_and_right_handed():
    for azimuth, elevation in ((-62.0, 24.0), (10.0, 5.0), (200.0, 80.0)):
        axes = Camera(azimuth, elevation).axes_W
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1.0)


def test_camera_from_above_sees_the_ground_in_true_proportion():
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.3], [0.0, 1.0, -0.2]])
    image = Camera(azimuth=-90.0, elevation=90.0).project(points)
    np.testing.assert_allclose(image, points[:, :2], atol=1e-12)


def test_chords_end_on_the_rim_and_lie_on_their_line():
    centre, radius = np.array([0.3, -0.2]), 0.8
    lines = np.array([[0.4, 0.0, 1.4], [5.0, 0.0, np.pi / 2], [0.0, 0.5, 0.1]])
    ends = chords(lines, centre, radius)
    assert len(ends) == 2  # the second line passes the disc by
    np.testing.assert_allclose(np.linalg.norm(ends - centre, axis=-1), radius)
    np.testing.assert_allclose(signed_distance(lines[[0, 2], None, :], ends), 0.0, atol=1e-12)


def test_styles_differ_and_are_the_same_in_every_figure():
    names = [f"LMTR-{n}" for n in range(8)]
    styles = series_styles(names)
    assert len({style.colour for style in styles.values()}) == len(names)
    assert styles_for(["LMTR-5"], styles)["LMTR-5"] == styles["LMTR-5"]
    with pytest.raises(ConfigurationError, match="library"):
        styles_for(["library"], styles)


def test_resampled_where_it_was_sampled_is_the_same_motion():
    motion = trot()
    again = resampled(motion, motion.times)
    for name in ("base_position_W", "base_rpy", "base_velocity_W", "foot_force_W", "contact"):
        np.testing.assert_allclose(getattr(again, name), getattr(motion, name), atol=1e-12)


def test_between_coarse_samples_no_foot_slides_or_pushes_at_the_air():
    motion = trot(dt=0.1)
    fine = resampled(motion, np.arange(0.0, 2.0, 0.013))
    assert not fine.foot_force_W[~fine.contact].any()
    for k in range(N_FEET):
        holds = motion.footholds.position_W[motion.footholds.foot == k]
        standing = fine.foot_position_W[fine.contact[:, k], k, :2]
        nearest = np.linalg.norm(standing[:, None] - holds, axis=-1).min(axis=1)
        np.testing.assert_allclose(nearest, 0.0, atol=1e-12)


def test_feet_stand_at_the_end_only_if_their_stance_lasts_until_then():
    motion = cut_short(trot(), 1.15)
    again = resampled(motion, np.array([0.95, 1.05, 1.15]))
    np.testing.assert_array_equal(again.contact[0], True)
    np.testing.assert_array_equal(again.contact[1:], [[False, True, True, False]] * 2)
    assert not again.foot_force_W[1:, [0, 3]].any()
    assert (again.foot_force_W[1:, [1, 2], 2] > 0.0).all()
