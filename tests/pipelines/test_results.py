"""The results page says what the lake holds, where from, and what is missing."""

import json
import re
import shutil

import numpy as np
import pytest

from lmtr.errors import DataError
from lmtr.rollout.comparison import Ratio, Tallies
from lmtr.rollout.tally import NAMES
from pipelines.config import load
from pipelines.results.blocks import Chapter, Measure, Row, Table
from pipelines.results.claims import at_least, at_most, claims_chapter, targets_chapter
from pipelines.results.differences import AMOUNT, changes, in_words, otherwise_varied, varied
from pipelines.results.groups import Group, Groups
from pipelines.results.markdown import write_page
from pipelines.results.parts import Part
from pipelines.results.ratios import BEST, PLAIN, SELECTED, pairs
from services.home import Home
from services.lake.tables import Lake

W = (1.0, 1.0, 1.0, 1.0)


def group(latent, policy="nearest", close=1.0, violation=1.0, weights=W, seeds=1, **sums):
    """A replanner with ``close`` of 10 steps close, and so many mm of mean violation."""
    shape = (1 if latent is None else seeds, 20)
    scale = np.linspace(0.8, 1.2, 20) * np.ones(shape)
    columns = {name: np.ones(shape) for name in NAMES}
    columns |= {"steps": np.full(shape, 10.0), "falls": np.zeros(shape)}
    columns |= {"close_steps": close * scale, "violation": 1e-3 * violation * scale}
    columns |= {name: np.full(shape, value) for name, value in sums.items()}
    row = {"evaluation_id": f"{latent}-{policy}-{weights}", "summary": [("nbytes", 2e6)]}
    return Group(latent, policy, weights, [row], Tallies(columns))


def cells(chapter):
    """Rows of the chapter's only table, by header."""
    (table,) = chapter.blocks
    return [dict(zip(table.headers, row.cells, strict=True)) for row in table.rows]


OTHER = (1.0, 1.0, 5.0, 1.0)
STUDY = Groups(
    [
        group(0, close=3.0, violation=0.1),
        group(6, close=1.0, violation=0.2, velocity_jump=0.01),
        group(6, close=2.0, violation=0.1, weights=OTHER),
        group(6, "selected", close=0.05, violation=0.05, distance=0.9),
        group(12, close=0.9, violation=0.3, velocity_jump=0.01),
        group(None, close=1.0, violation=2.0, velocity_jump=0.1),
        group(None, close=2.0, violation=1.0, weights=OTHER),
        group(None, "selected", close=0.1, violation=0.5),
    ],
    W,
)


def test_claims_are_answered_by_the_numbers():
    unimodal, plateau, matches, *milder, _, _ = cells(claims_chapter(STUDY))
    assert unimodal["ratio (×)"].value == pytest.approx(3.0 / 0.9)
    assert unimodal["verdict"] == "yes"
    assert plateau["ratio (×)"].value == pytest.approx(0.9)
    assert plateau["verdict"] == "yes"
    assert matches["ratio (×)"].value == pytest.approx(0.9)
    assert matches["verdict"] == "yes, and fewer"
    assert milder[0]["ratio (×)"].value == pytest.approx(10.0)
    assert milder[0]["verdict"] == "yes"
    # The upper end of the front is reached by half of the draws only, so it decides nothing.
    assert "least of 8 levels" in milder[0]["ours"]
    assert "the library's front has 10.0 to 20.0 %" in milder[0]["ours"]


def test_the_same_rules_deny_what_the_numbers_deny():
    study = Groups(
        [
            group(0, close=1.0),
            group(6, close=2.0, violation=1.0),
            group(6, close=1.0, violation=2.0, weights=OTHER),
            group(12, close=1.0),
            group(None, close=0.5, violation=1.0),
            group(None, close=1.5, violation=0.9, weights=OTHER),
        ],
        W,
    )
    unimodal, plateau, matches, *milder, _, _ = cells(claims_chapter(study))
    assert unimodal["verdict"] == "yes"  # a ratio of 1 is at least 1
    assert plateau["verdict"] == "no"
    assert matches["verdict"] == "no"
    assert {row["verdict"] for row in milder} == {"no"}


def test_targets_are_measured_along_the_front():
    rows = cells(targets_chapter(STUDY))
    named = {}
    for row in rows:
        named.setdefault(row["figure"], []).append(row)
    jumps = named["jumps at replanning, library over LMTR"]
    assert jumps[0]["measured"].value == pytest.approx(10.0)
    assert jumps[0]["verdict"] == "yes"
    (slow,) = named["distance, selecting over plain"]
    assert "LMTR-6, selected" in slow["ours"]
    assert slow["measured"].value == pytest.approx(0.9)
    assert slow["verdict"] == "no"
    (safest,) = named["close footholds (%), best LMTR, none diverged"]
    assert safest["measured"].value == pytest.approx(0.5)
    assert safest["verdict"] == "yes"


def test_a_fall_denies_the_safest():
    study = Groups([group(6, close=0.01, falls=1.0), group(None)], W)
    row = next(r for r in cells(targets_chapter(study)) if "none diverged" in r["figure"])
    assert row["verdict"] == "no"
    assert "20 of 20 rollouts diverged" in row["ours"]


def test_nothing_evaluated_is_said_and_not_judged():
    for chapter in (claims_chapter(Groups([], W)), targets_chapter(Groups([], W))):
        verdicts = {row["verdict"] for row in cells(chapter)}
        assert verdicts <= {"not evaluated", "see docs/benchmarks.md"}


def test_pairs_are_held_against_each_other_at_equal_avoidance():
    found = {(pair.kind, pair.latent): pair for pair in pairs(STUDY)}
    assert set(found) == {(PLAIN, 6), (BEST, None), (SELECTED, 6)}
    plain = found[PLAIN, 6].levels["mean_violation"]
    assert [at.close_share for at in plain] == pytest.approx(np.linspace(0.1, 0.2, 9))
    assert all(at.ratio.value == pytest.approx(10.0) for at in plain)
    best = found[BEST, None].levels["mean_violation"]
    # At either point of the library the LMTR that selects is safer and violates least.
    assert [at.ratio.value for at in best] == pytest.approx([2.0 / 0.05, 1.0 / 0.05])
    assert any("6-selected" in each for each in found[BEST, None].ids)


def test_verdicts_tell_the_value_from_its_interval():
    assert at_least(Ratio(6.0, 5.5, 7.0), 5.0) == "yes"
    assert at_least(Ratio(6.0, 4.0, 7.0), 5.0) == "value yes, interval no"
    assert at_least(Ratio(4.0, 3.0, 7.0), 5.0) == "no"
    assert at_least(Ratio(np.nan, np.nan, np.nan), 5.0) == "not judged"
    assert at_most(Measure(0.5, 0.1, 1.5), 1.0) == "value yes, interval no"
    assert at_most(Measure(0.5), 1.0) == "yes"


def test_a_number_is_printed_with_its_interval():
    assert str(Measure(1.234, 1.0, 2.0)) == "1.23 (1.00–2.00)"
    assert str(Measure(5.0, 4.0, np.inf, at_least=True)) == "≥ 5.00 (4.00–∞)"
    assert str(Measure(0.0)) == "0"
    assert Measure(np.nan, np.nan, np.nan).as_json()["value"] == "nan"


def test_variants_are_told_by_what_they_change():
    base = load(None, [])
    configs = {
        "base": base,
        "less": load(None, ["training.segments=5000", "training.latent=[6]"]),
        "kappa": load(None, ["training.model.kappa=0.004"]),
        "both": load(None, ["training.segments=5000", "training.mirror=false"]),
        "same": load(None, ["cluster.workers=1", "evaluation.rollouts=5"]),
    }
    parts = [Part(name, config, config.dataset_id) for name, config in configs.items()]
    assert changes(base, configs["same"]) == {}
    assert in_words(changes(base, configs["both"])) == (
        "training.mirror = off; training.segments = 5000"
    )
    assert [part.name for part in varied(parts, AMOUNT)] == ["base", "less"]
    assert [part.name for part in otherwise_varied(parts)] == ["both", "same"]


def test_names_of_a_page_are_unique(tmp_path):
    table = Table("a", "", ["x"], [Row([1])])
    with pytest.raises(DataError, match=r"\['a'\] more than once"):
        write_page("Page", [], [Chapter("One", [table, table])], tmp_path)


def results_of(home, lmtr, config, *more):
    status, _, err = lmtr("results", config, "--no-films", "--home", home, *more)
    assert status == 0, err
    (folder,) = (home / "reports").glob("*/results")
    page = (folder / "results.md").read_text("utf-8")
    return folder, page, json.loads((folder / "numbers.json").read_text("utf-8"))


@pytest.fixture
def copied(tmp_path, request):
    """A copy of a shared home."""

    def copy(name):
        return shutil.copytree(request.getfixturevalue(name), tmp_path / name)

    return copy


@pytest.mark.slow
def test_a_finished_study_becomes_a_page_whose_numbers_are_the_lake_s(copied, lmtr, tiny_config):
    home = copied("tiny_home")
    folder, page, numbers = results_of(home, lmtr, tiny_config)
    lake = Lake(Home.open(home, create=False).lake)
    known = {
        *lake.values("evaluations", "evaluation_id"),
        *lake.values("models", "model_id"),
        *lake.values("datasets", "dataset_id"),
    }
    rows = [row for table in numbers.values() for row in table]
    assert {each for row in rows for each in row["from"]} <= known
    evaluated = {each for row in numbers["replanners"] for each in row["from"]}
    assert evaluated == set(lake.values("evaluations", "evaluation_id"))
    for row in numbers["replanners"]:
        (evaluation,) = row["from"]
        (found,) = lake.read(
            "evaluations", ["summary"], where=f"evaluation_id = '{evaluation}'"
        ).to_pylist()
        shown, stored = row["row"]["distance (m)"]["value"], dict(found["summary"])["distance"]
        assert shown == pytest.approx(stored)
    assert {row["from"][0] for row in numbers["training"]} == set(lake.values("models", "model_id"))
    pictures = re.findall(r"\]\((images/[^)]+)\)", page)
    assert len(set(pictures)) == len(pictures) >= 12
    for picture in pictures:
        assert (folder / picture).stat().st_size > 1000
        assert (folder / "figures" / picture[len("images/") :].replace(".png", ".pdf")).is_file()
    assert "no variants" in page


def test_what_is_not_made_yet_is_named_and_the_rest_is_shown(copied, lmtr, tiny_config):
    _, page, numbers = results_of(copied("cut_home"), lmtr, tiny_config)
    assert "Missing: base: 2 of 2 models are not trained yet." in page
    assert "Missing: Nothing has been evaluated yet" in page
    assert {row["row"]["verdict"] for row in numbers["claims"]} == {"not evaluated"}
    assert "data-0-quantities" in numbers


def test_a_study_without_its_data_set_is_no_error(copied, lmtr, tiny_config):
    changed = ["--set", "dataset.seed=77"]
    _, page, _ = results_of(copied("cut_home"), lmtr, tiny_config, *changed)
    assert "has no segments; run `lmtr segment` first" in page
