"""Figures of data sets, learning and replanners show the numbers they are given."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from lmtr.errors import DataError
from lmtr.figures.dataset import (
    Violation,
    cost_figure,
    effort_figure,
    margin_figure,
    outcome_figure,
    violation_figure,
)
from lmtr.figures.distributions import (
    DISTANCE_BIN,
    VIOLATION_BIN,
    distribution_figure,
    draw_distances,
    draw_violations,
)
from lmtr.figures.learning import learning_figure
from lmtr.figures.modes import Colouring, modes_figure
from lmtr.figures.style import save, series_styles
from lmtr.figures.trade_off import TradeOff, trade_off_figure

RNG = np.random.default_rng(0)


def test_outcome_bars_are_the_counts_sorted():
    figure = outcome_figure(75, {"drift": 3, "cost": 20})
    bars = figure.axes[0].patches
    assert [bar.get_width() for bar in bars] == [75, 20, 3]
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == ["accepted", "cost", "drift"]


def test_cost_histogram_counts_every_solution_once():
    accepted, rejected = RNG.gamma(9.0, 0.3, 300), RNG.gamma(20.0, 0.3, 100)
    figure = cost_figure(accepted, [*rejected, np.nan], limit=6.0)
    heights = sum(patch.get_height() for patch in figure.axes[0].patches)
    assert heights == 400  # stacked; the unsolved one has no cost
    assert "rejected (100)" in figure.axes[0].get_legend_handles_labels()[1]


def test_effort_bins_hold_whole_iterations():
    iterations = RNG.integers(20, 200, 500)
    axes = effort_figure(RNG.gamma(9.0, 0.07, 500), iterations).axes[1]
    widths = {round(patch.get_width(), 9) for patch in axes.patches}
    assert len(widths) == 1
    assert float(widths.pop()).is_integer()
    assert sum(patch.get_height() for patch in axes.patches) == 500
    median = next(line for line in axes.lines if line.get_label().startswith("median"))
    assert median.get_xdata()[0] == np.median(iterations)


def test_violation_curves_end_at_all_solutions_and_tell_the_share_beyond():
    values = np.linspace(0.0, 0.1, 101)
    figure = violation_figure(
        {"drift": Violation(values, "m", 0.0801), "slip": Violation(values, "m")}
    )
    drift, slip = figure.axes
    assert drift.get_title(loc="left") == "limit 0.0801 m: 19.8 % beyond"
    assert slip.get_title(loc="left") == ""
    for axes in (drift, slip):
        curve = axes.lines[0]
        assert curve.get_ydata()[-1] == 100.0
        assert (np.diff(curve.get_xdata()) >= 0.0).all()


def test_margins_are_shares_of_lines():
    figure = margin_figure(np.abs(RNG.normal(0, 0.04, 200)), RNG.normal(0.23, 0.03, 50))
    heights = [patch.get_height() for patch in figure.axes[0].patches]
    assert sum(heights) == pytest.approx(200.0)  # two histograms of 100 % each
    assert "(cm)" in figure.axes[0].get_xlabel()


def curves(axes):
    """Centres of bins and densities by replanner."""
    return {
        line.get_label().split(":")[0]: line.get_xydata().T
        for line in axes.lines
        if len(line.get_xdata()) > 2
    }


def test_distance_densities_have_area_one_and_give_the_close_share():
    data = {"unimodal": [np.abs(RNG.normal(0, 0.1, 900))], "LMTR-6": [RNG.gamma(20, 0.02, 700)]}
    axes = Figure().subplots()
    draw_distances(axes, data, 0.05, series_styles(data))
    drawn = curves(axes)
    assert set(drawn) == set(data)
    for centres, density in drawn.values():
        assert (density * DISTANCE_BIN).sum() == pytest.approx(1.0)
        np.testing.assert_allclose(np.diff(centres), DISTANCE_BIN)
        assert centres[0] == DISTANCE_BIN / 2.0
    share = 100.0 * np.mean(data["unimodal"][0] < 0.05)
    assert f"unimodal: {share:.1f} % under 5 cm" in axes.get_legend_handles_labels()[1]
    assert not axes.collections  # one array alone has no band


def test_violation_areas_are_the_share_of_violating_samples():
    values = np.where(RNG.random(20_000) < 0.03, RNG.exponential(0.02, 20_000), 0.0)
    axes = Figure().subplots()
    draw_violations(axes, {"library": [values]}, 0.05, series_styles(["library"]))
    ((_, density),) = curves(axes).values()
    assert np.nansum(density) * VIOLATION_BIN == pytest.approx(np.mean(values > 0.0))
    assert axes.get_yscale() == "log"
    assert axes.get_ylim()[1] < 3.0 * np.nanmax(density)  # zoomed: zeros do not set the scale


def test_replanner_without_any_violation_is_still_drawn():
    data = {"expert": [np.full(50, 0.2)]}
    figure = distribution_figure(data, {"expert": [np.zeros(80)]})
    figure.canvas.draw()
    legend = figure.axes[1].get_legend().get_texts()
    assert [text.get_text() for text in legend] == ["expert: mean 0 mm, 0 % over 5 cm"]


def test_bands_hold_the_curve_and_shrink_with_the_number_of_rollouts():
    rollouts = [np.abs(RNG.normal(0.12, 0.05, 40)) for _ in range(80)]

    def width(count):
        axes = Figure().subplots()
        chosen = {"LMTR-6": rollouts[:count]}
        draw_distances(axes, chosen, 0.05, series_styles(chosen))
        (band,) = axes.collections
        ends = band.get_paths()[0].vertices
        ((centres, density),) = curves(axes).values()
        bulk = density > 0.02
        spans = []
        for x, y in zip(centres[bulk], density[bulk], strict=True):
            there = ends[np.isclose(ends[:, 0], x), 1]
            assert there.min() <= y <= there.max()
            spans.append(np.ptp(there))
        return np.mean(spans)

    assert width(80) < 0.75 * width(20)


def test_replanners_that_are_not_highlighted_share_one_entry_of_the_legend():
    data = {f"LMTR-{n}": [RNG.gamma(20, 0.01, 200)] for n in range(1, 6)}
    figure = distribution_figure(data, data, highlighted=["LMTR-3"])
    for axes in figure.axes:
        entries = [text.get_text() for text in axes.get_legend().get_texts()]
        assert [entry.split(":")[0] for entry in entries] == ["LMTR-3", "others"]
        assert len(curves(axes)) == 3  # LMTR-3, others, and further others without a name


def test_distributions_must_name_the_same_replanners():
    with pytest.raises(DataError, match="same replanners"):
        distribution_figure({"a": [np.ones(3)]}, {"b": [np.ones(3)]})
    with pytest.raises(DataError, match="no finite value"):
        distribution_figure({"a": [[np.nan]]}, {"a": [[0.0]]})


def history(n):
    return [
        {"epoch": k, "train_loss": 1.0 / k, "validation_loss": 2.0 / k, "validation_kl": float(k)}
        for k in range(1, n + 1)
    ]


def test_learning_curves_are_the_records():
    figure = learning_figure({"LMTR-3": history(5), "LMTR-6": history(3)})
    loss, kl = figure.axes
    assert loss.get_yscale() == "log"
    assert kl.get_yscale() == "linear"
    curves = {line.get_label(): line.get_ydata() for line in loss.lines}
    np.testing.assert_allclose(curves["LMTR-3, validation"], 2.0 / np.arange(1, 6))
    np.testing.assert_allclose(curves["LMTR-6, train"], 1.0 / np.arange(1, 4))
    assert [line.get_label() for line in kl.lines] == ["LMTR-3, validation", "LMTR-6, validation"]
    (legend,) = figure.legends  # each model once, however many curves it has
    assert [text.get_text() for text in legend.get_texts()] == [
        "LMTR-3",
        "LMTR-6",
        "train",
        "validation",
    ]


def test_trade_off_points_are_at_their_place_in_per_cent():
    figure = trade_off_figure(
        {"library": [TradeOff(0.163, 1.77, "w = 1, 1"), TradeOff(0.033, 2.55)]}
    )
    points = next(line for line in figure.axes[0].lines if line.get_label() == "library")
    np.testing.assert_allclose(points.get_xydata(), [[3.3, 2.55], [16.3, 1.77]])


def test_only_points_that_no_other_beats_are_joined_and_have_intervals():
    interval = {"close_interval": (0.02, 0.05), "violation_interval": (2.0, 3.0)}
    series = [
        TradeOff(0.033, 2.55, **interval),
        TradeOff(0.163, 1.77, reported=True, **interval),
        TradeOff(0.2, 3.0, **interval),  # worse in both
    ]
    (axes,) = trade_off_figure({"library": series}).axes
    front = next(line for line in axes.lines if line.get_label() == "_front")
    np.testing.assert_allclose(front.get_xydata(), [[3.3, 2.55], [16.3, 1.77]])
    bars = [line.get_xydata() for line in axes.lines if len(line.get_xdata()) == 2]
    spans = sorted(tuple(np.ptp(bar, axis=0).round(9)) for bar in bars if np.ptp(bar, 0).min() == 0)
    assert spans == [(0.0, 1.0)] * 2 + [(3.0, 0.0)] * 2
    (star,) = [line for line in axes.lines if line.get_label() == "_reported"]
    np.testing.assert_allclose(star.get_xydata(), [[16.3, 1.77]])
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["w that is reported"]


def test_violations_that_differ_by_much_are_on_a_logarithmic_axis():
    def scale(violation):
        points = {"a": [TradeOff(0.1, violation)], "b": [TradeOff(0.2, 0.1)]}
        return trade_off_figure(points).axes[0].get_yscale()

    assert scale(0.2) == "linear"
    assert scale(2.0) == "log"


def test_no_violation_at_all_has_its_place_on_a_logarithmic_axis():
    points = {"a": [TradeOff(0.1, 0.0), TradeOff(0.05, 3.0)], "b": [TradeOff(0.2, 0.1)]}
    (axes,) = trade_off_figure(points).axes
    low, _ = axes.get_ylim()
    assert low < 0.0
    assert axes.get_yticks()[0] == 0.0
    below, least, most = axes.transData.transform([(0.0, 0.0), (0.0, 0.1), (0.0, 3.0)])[:, 1]
    assert below < least < most


def test_modes_are_shown_along_the_dimensions_in_use():
    modes = RNG.normal(size=(60, 5)) * [0.1, 1.0, 0.01, 2.0, 0.02]
    stride = Colouring("stride (m)", modes[:, 1])
    foot = Colouring("first foot", RNG.integers(0, 4, 60), is_foot=True)
    figure = modes_figure(modes, [stride, foot], dimensions=(1, 3))
    panel = figure.axes[0]
    drawn = panel.collections[0]
    shown = modes[:, [1, 3]]
    rows = [int(np.abs(shown - point).sum(axis=1).argmin()) for point in drawn.get_offsets()]
    np.testing.assert_allclose(drawn.get_offsets(), shown[rows])
    np.testing.assert_allclose(drawn.get_array(), stride.values[rows])
    assert len(set(rows)) >= 56  # all but the outermost of each dimension
    solid = modes_figure(modes, [stride]).axes[0]
    assert [solid.get_xlabel(), solid.get_ylabel(), solid.get_zlabel()] == [
        "$z_{1}$ (–)",
        "$z_{2}$ (–)",
        "$z_{4}$ (–)",
    ]


@pytest.mark.parametrize(
    "draw",
    [
        lambda: outcome_figure(0, {}),
        lambda: cost_figure([], []),
        lambda: effort_figure([], [3]),
        lambda: violation_figure({}),
        lambda: margin_figure([np.nan], []),
        lambda: distribution_figure({}, {}),
        lambda: learning_figure({"LMTR-3": []}),
        lambda: trade_off_figure({"library": []}),
        lambda: modes_figure(np.zeros((4, 1)), [Colouring("x (m)", np.zeros(4))]),
        lambda: modes_figure(np.zeros((4, 3)), []),
        lambda: modes_figure(np.zeros((4, 3)), [Colouring("x (m)", np.zeros(3))]),
    ],
)
def test_nothing_to_draw_is_refused(draw):
    with pytest.raises(DataError):
        draw()


def test_every_axis_of_statistics_has_a_label(tmp_path):
    figures = [
        outcome_figure(5, {"cost": 2}),
        cost_figure([1.0, 2.0], [3.0]),
        effort_figure([0.5, 0.6], [40, 50]),
        margin_figure([0.01], [0.2]),
        distribution_figure({"a": [[0.1, 0.2]]}, {"a": [[0.0, 0.01]]}),
        learning_figure({"LMTR-3": history(3)}),
        trade_off_figure({"a": [TradeOff(0.1, 1.0)]}),
    ]
    for k, figure in enumerate(figures):
        for axes in figure.axes:
            assert axes.get_xlabel()
            assert axes.get_ylabel() or axes.get_yticklabels()[0].get_text() == "accepted"
        assert save(figure, tmp_path / f"{k}.png", resolution=40).stat().st_size > 1000
