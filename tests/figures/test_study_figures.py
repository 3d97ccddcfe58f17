"""Figures of a study show its means, seeds, intervals and references at their places."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text

from lmtr.errors import DataError
from lmtr.figures.dots import Dot, DotPanel, dot_figure
from lmtr.figures.front_ratio import front_ratio_figure
from lmtr.figures.labels import PointLabel, label_points
from lmtr.figures.modes import Colouring, modes_figure
from lmtr.figures.replanner_styles import latent_colour, replanner_style
from lmtr.figures.strategies import Strategies, strategies_figure
from lmtr.figures.style import save
from lmtr.figures.sweep import Reference, SweepPanel, SweepSeries, sweep_figure
from lmtr.rollout.comparison import AtLevel, Ratio
from lmtr.rollout.summary import Estimate
from lmtr.vectors.segment_vector import decode_segment

RNG = np.random.default_rng(0)


def lines(axes, label):
    return [line for line in axes.lines if line.get_label() == label]


def test_a_sweep_draws_means_in_the_order_of_the_parameter():
    series = SweepSeries(
        "LMTR-n", {12.0: [4.0, 6.0], 0.0: [20.0], 3.0: [9.0, 11.0]}, {3.0: (7, 12)}
    )
    panel = SweepPanel("Avoidance", "close (%)", [series], [Reference("library", 3.0, (2.0, 4.0))])
    figure = sweep_figure([panel], "latent dimension n")
    (axes,) = figure.axes
    (mean,) = lines(axes, "LMTR-n")
    np.testing.assert_allclose(mean.get_xydata(), [[0, 20.0], [1, 10.0], [2, 5.0]])
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0", "3", "12"]
    (library,) = lines(axes, "library")
    assert set(library.get_ydata()) == {3.0}
    (bars,) = [container for container in axes.containers if container.has_yerr]
    (segment,) = bars[2][0].get_segments()
    np.testing.assert_allclose(segment[:, 1], [7.0, 12.0])
    dots = [line for line in axes.lines if line.get_marker() == "o" and line.get_alpha() == 0.7]
    assert sorted(y for line in dots for y in line.get_ydata()) == [4.0, 6.0, 9.0, 11.0]
    assert axes.get_ylim()[0] == 0.0
    assert axes.get_ylim()[1] > 20.0


def test_a_parameter_that_some_series_lack_leaves_gaps_there():
    panel = SweepPanel(
        "Avoidance",
        "close (%)",
        [SweepSeries("a", {0.0: [2.0], 1.0: [3.0], 2.0: [4.0]}), SweepSeries("b", {2.0: [1.0]})],
    )
    (axes,) = sweep_figure([panel], "n").axes
    (b,) = lines(axes, "b")
    assert len(b.get_xdata()) == 1
    assert round(float(b.get_xdata()[0])) == 2


def test_dots_lie_in_the_rows_of_their_alternatives():
    dots = {
        ("nearest", "LMTR-6"): Dot(10.0, (8.0, 12.0), (9.0, 11.0)),
        ("selected", "LMTR-6"): Dot(2.0, (1.0, 3.0)),
        ("nearest", "library"): Dot(7.0),
    }
    figure = dot_figure([DotPanel("close (%)", dots)], ["nearest", "selected"])
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.get_yticklabels()] == ["nearest", "selected"]
    marks = {
        float(line.get_xdata()[0]): float(line.get_ydata()[0])
        for line in axes.lines
        if line.get_marker() not in ("None", "|")
    }
    assert {value: round(row) for value, row in marks.items()} == {10.0: 0, 2.0: 1, 7.0: 0}
    assert marks[10.0] < marks[7.0]  # series of a row do not cover each other
    ends = [tuple(line.get_xdata()) for line in axes.lines if len(line.get_xdata()) == 2]
    assert (8.0, 12.0) in ends
    assert (1.0, 3.0) in ends


def level(close, value, low=np.nan, high=np.nan, at_least=False):
    unknown = Estimate(np.nan, np.nan, np.nan)
    return AtLevel(close, unknown, unknown, Ratio(value, low, high, at_least), 1.0)


def test_ratios_are_drawn_over_the_share_of_close_steps_with_their_targets():
    curve = [level(0.15, 4.0, 3.0, 5.0), level(0.05, 8.0, 6.0, np.inf)]
    figure = front_ratio_figure({"mean": {"LMTR-6": curve}})
    (axes,) = figure.axes
    (drawn,) = lines(axes, "LMTR-6")
    np.testing.assert_allclose(drawn.get_xydata(), [[5.0, 8.0], [15.0, 4.0]])
    (band,) = (each for each in axes.collections if isinstance(each, PolyCollection))
    assert band.get_paths()[0].vertices[:, 1].min() == 3.0
    assert axes.get_yscale() == "log"
    assert axes.get_ylim()[1] > 10.0  # both targets are in view
    assert {text.get_text() for text in axes.texts} == {"5×", "10×"}


def test_ratios_of_zero_and_infinity_are_arrows_and_not_lines():
    curve = [level(0.05, 0.0), level(0.1, 3.0), level(0.15, np.inf)]
    (axes,) = front_ratio_figure({"severe": {"LMTR-6": curve}}).axes
    (drawn,) = lines(axes, "LMTR-6")
    np.testing.assert_array_equal(np.isfinite(drawn.get_ydata()), [False, True, False])
    arrows = {line.get_marker(): line.get_xdata() for line in axes.lines if len(line.get_xdata())}
    np.testing.assert_allclose(arrows["v"], [5.0])
    np.testing.assert_allclose(arrows["^"], [15.0])


def test_labels_cover_neither_each_other_nor_the_points():
    axes = Figure(figsize=(4, 3)).subplots()
    x, y = np.linspace(0.3, 0.7, 6), np.full(6, 0.5)
    axes.plot(x, y, "o")
    axes.set(xlim=(0, 1), ylim=(0, 1))
    texts = label_points(
        axes, [PointLabel(f"LMTR-{k}", *at, "black") for k, at in enumerate(zip(x, y, strict=True))]
    )
    renderer = FigureCanvasAgg(axes.figure).get_renderer()
    boxes = [Text.get_window_extent(text, renderer) for text in texts]
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])
        places = axes.transData.transform(np.stack([x, y], axis=-1))
        assert not any(box.contains(*place) for place in places)


def test_modes_have_a_panel_for_neighbourhoods_of_tasks():
    modes = RNG.normal(size=(300, 3))
    near = [modes[:16], modes[16:20]]
    figure = modes_figure(modes, [Colouring("stride (m)", modes[:, 0])], neighbourhoods=near)
    panel = [axes for axes in figure.axes if axes.name == "3d"][-1]
    cloud, *groups = panel.collections
    assert [len(group._offsets3d[0]) for group in groups] == [16, 4]
    np.testing.assert_allclose(np.sort(groups[1]._offsets3d[2]), np.sort(near[1][:, 2]))
    assert len(cloud._offsets3d[0]) <= len(modes)
    assert [text.get_text() for text in panel.get_legend().get_texts()] == ["1", "2"]


def test_strategies_show_the_next_footholds_of_every_mode(walk_segments):
    plans = decode_segment(walk_segments.tau[:5])
    lines_S = np.array([[0.4, 0.0, np.pi / 2.0]])
    figure = strategies_figure([Strategies("(a) five modes", lines_S, plans)])
    (axes,) = figure.axes
    (crosses,) = [line for line in lines(axes, "LF") if line.get_marker() == "x"]
    np.testing.assert_allclose(crosses.get_xydata(), plans.footholds[:, 0, -1, :2])
    feet = plans.footholds[..., :2].reshape(-1, 2)
    assert axes.get_xlim()[0] < feet[:, 0].min()
    assert axes.get_xlim()[1] > feet[:, 0].max()


def test_latent_dimensions_darken_and_families_differ():
    light = [sum(to_rgb(latent_colour(n))) for n in (1, 2, 4, 8, 16)]
    assert light == sorted(light, reverse=True)
    looks = [replanner_style(n, p) for n in (None, 0, 6) for p in ("nearest", "selected")]
    kinds = {(style.colour, style.marker) for style in looks}
    assert len(kinds) == 5  # the unimodal regressor has nothing to select among


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_figures_are_the_same_file_every_time(tmp_path, ending):
    def write(name):
        panel = SweepPanel("A", "a (–)", [SweepSeries("s", {0.0: [1.0], 1.0: [2.0]})])
        return save(sweep_figure([panel], "n"), tmp_path / f"{name}.{ending}").read_bytes()

    first, second = write("a"), write("b")
    assert len(first) > 1000
    assert first == second


@pytest.mark.parametrize(
    "draw",
    [
        lambda: sweep_figure([], "n"),
        lambda: sweep_figure([SweepPanel("A", "a (–)", [])], "n"),
        lambda: sweep_figure([SweepPanel("A", "a (–)", [SweepSeries("s", {0.0: [np.nan]})])], "n"),
        lambda: dot_figure([], ["a"]),
        lambda: dot_figure([DotPanel("a (–)", {("b", "s"): Dot(1.0)})], ["a"]),
        lambda: front_ratio_figure({"mean": {"a": [level(0.1, np.nan)]}}),
        lambda: strategies_figure([]),
    ],
)
def test_nothing_to_draw_is_refused(draw):
    with pytest.raises(DataError):
        draw()
