"""Weights are searched for on courses of their own, once, and what is found is evaluated."""

import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest

from lmtr.errors import ConfigurationError, DataError
from lmtr.policies.distance import TaskWeights
from lmtr.rollout.fronts import chosen
from lmtr.rollout.tally import NAMES, RATES
from pipelines.config import as_toml, load
from pipelines.registry import Registered
from pipelines.tuning import tuned_models
from services.home import Home
from services.lake.tables import Lake

SEARCH = (
    "evaluation.tuning.chi_base=[1.0, 2.0]",
    "evaluation.tuning.chi_feet=[1.0]",
    "evaluation.tuning.eta=[1.0, 2.0]",
    "evaluation.tuning.gamma=[1.0]",
    "evaluation.tuning.rollouts=3",
    "evaluation.tuning.seed=9",
    "evaluation.tuning.points=2",
    "evaluation.keep_motions=1",
)
SETS = [part for change in SEARCH for part in ("--set", change)]


def searched(home, lmtr, tiny_config, *more):
    """Evaluate with a search; returns what was said."""
    status, _, err = lmtr("evaluate", "-c", tiny_config, *SETS, *more, "--home", home)
    assert status == 0, err
    return err


def test_a_grid_leaves_out_multiples_and_nothing_else():
    section = load(
        None,
        [
            "evaluation.tuning.chi_base=[0.0, 1.0, 2.0]",
            "evaluation.tuning.chi_feet=[0.0, 1.0, 2.0]",
            "evaluation.tuning.eta=[0.0]",
            "evaluation.tuning.gamma=[0.0]",
        ],
    ).evaluation
    values = [weights.values[:2] for weights in section.tuning.grid()]
    assert values == [(0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (1.0, 2.0), (2.0, 1.0)]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["evaluation.tuning.seed=0"], ["tuning.seed must differ", "got 0 for both"]),
        (
            ["evaluation.tuning.seed=1", 'evaluation.policies=["selected"]'],
            ["'nearest', which is not among policies ['selected']"],
        ),
        (["evaluation.tuning.eta=[]"], ["evaluation.tuning.eta", "at least 1"]),
        (["evaluation.tuning.latent=[0]"], ["evaluation.tuning.latent", "greater than"]),
        (["evaluation.tuning.gamme=[1.0]"], ["evaluation.tuning.gamme", "did you mean 'gamma'"]),
        (["evaluation.tuning.eta=[-1.0]"], ["evaluation.tuning.eta"]),
        (
            [f"evaluation.tuning.{n}=[0.0]" for n in ("chi_base", "chi_feet", "eta", "gamma")],
            ["not zero in all"],
        ),
        (
            ["training.latent=[0, 3]", "evaluation.tuning.latent=[3, 5]"],
            ["evaluation.tuning.latent", "[5]", "training.latent"],
        ),
    ],
)
def test_bad_searches_are_refused_in_one_line(changes, words):
    with pytest.raises(ConfigurationError) as refusal:
        load(None, changes)
    assert "\n" not in str(refusal.value)
    for word in words:
        assert word in str(refusal.value)


def test_a_search_is_written_down_and_read_back(tmp_path):
    config = load(None, list(SEARCH))
    path = tmp_path / "kept.toml"
    path.write_text(as_toml(config))
    assert load(str(path)) == config


def test_the_first_training_seed_is_tuned_and_unknown_latents_are_refused():
    known = [
        Registered(f"m{latent}{seed}", f"LMTR-{latent} seed {seed}", latent, seed)
        for latent in (0, 2, 3)
        for seed in (4, 5)
    ]
    section = load(None, list(SEARCH)).evaluation
    assert [model.model_id for model in tuned_models(section, known)] == ["m24", "m34"]
    some = load(None, [*SEARCH, "evaluation.tuning.latent=[3]"]).evaluation
    assert [model.model_id for model in tuned_models(some, known)] == ["m34"]
    other = load(None, [*SEARCH, "evaluation.tuning.latent=[7]"]).evaluation
    with pytest.raises(DataError, match=r"names \[7\].*\[2, 3\]"):
        tuned_models(other, known)
    assert tuned_models(load(None).evaluation, known) == []


def test_a_search_from_grid_to_reported_evaluations(lmtr, tiny_home, tiny_config, tmp_path):
    home = tmp_path / "home"
    shutil.copytree(tiny_home, home)
    said = searched(home, lmtr, tiny_config)
    lake = Lake(Home.open(home, create=False).lake)
    rows = lake.read("evaluations").to_pylist()
    search = [row for row in rows if row["purpose"] == "tuning"]
    # Of 2 × 2 w's (2, 1, 2, 1) and the others are no multiples of each other.
    assert len(search) == 2 * 4
    assert {(row["seed"], row["policy"]) for row in search} == {(9, "nearest")}
    assert {row["latent"] for row in search} == {2, None}
    assert len({row["mlflow_run_id"] for row in search}) == 2

    for latent in (2, None):
        tried = [row for row in search if row["latent"] == latent]
        summaries = [dict(row["summary"]) for row in tried]
        points = np.array([[s["close_share"], s["mean_violation"]] for s in summaries])
        fallen = np.array([s["diverged"] > 0 for s in summaries])
        best = {tuple(tried[k]["weights"]) for k in chosen(points, fallen, 2)}
        reported = {
            tuple(row["weights"])
            for row in rows
            if row["purpose"] == "report" and row["latent"] == latent and "w=" in row["replanner"]
        }
        assert best - {TaskWeights().values} <= reported
        for w in best:
            assert ",".join(f"{value:g}" for value in w) in said

    rollouts = lake.read("rollouts").to_pylist()
    ids = {row["evaluation_id"] for row in search}
    of_search = [row for row in rollouts if row["evaluation_id"] in ids]
    assert len(of_search) == 3 * 8
    assert all(row["t"] == row["violations"] == row["foothold_x"] == [] for row in of_search)
    assert all(set(dict(row["metrics"])) == set(NAMES) for row in of_search)
    status, _, err = lmtr("lake", "check", "--home", home)
    assert status == 0, err

    before = {name: lake.version(name) for name in lake.tables()}
    searched(home, lmtr, tiny_config)
    assert {name: lake.version(name) for name in lake.tables()} == before


@pytest.mark.slow
def test_an_interrupted_search_goes_on_and_workers_change_nothing(
    lmtr, tiny_home, tiny_config, tmp_path, monkeypatch
):
    """Once in this process, stopped in between, and once with two workers: the same numbers."""
    from pipelines import evaluation_record

    homes = [tmp_path / name for name in ("stopped", "whole")]
    for home in homes:
        shutil.copytree(tiny_home, home)
    kept = evaluation_record.Recorder.__call__

    def stopping(self, *arguments, _left=[3]):  # noqa: B006 - counts down over all calls
        if _left[0] == 0:
            raise KeyboardInterrupt
        _left[0] -= 1
        kept(self, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(evaluation_record.Recorder, "__call__", stopping)
        assert lmtr("evaluate", "-c", tiny_config, *SETS, "--home", homes[0])[0] != 0
    lake = Lake(Home.open(homes[0], create=False).lake)
    assert lake.query_value("SELECT count(*) FROM evaluations WHERE purpose = 'tuning'") == 3
    searched(homes[0], lmtr, tiny_config)
    searched(homes[1], lmtr, tiny_config, "--workers", 2)
    found = []
    for home in homes:
        lake = Lake(Home.open(home, create=False).lake)
        rows = lake.read("rollouts", ["rollout_id", "metrics"], order_by="rollout_id").to_pylist()
        found.append({row["rollout_id"]: dict(row["metrics"]) for row in rows})
    assert found[0] == found[1]


def test_rates_of_stored_sums_are_those_of_the_summary(tiny_home):
    lake = Lake(Home.open(tiny_home, create=False).lake)
    for row in lake.read("evaluations").to_pylist():
        summary = dict(row["summary"])
        where = f"evaluation_id = '{row['evaluation_id']}'"
        sums = [dict(each["metrics"]) for each in lake.read("rollouts", where=where).to_pylist()]
        for name, (part, whole) in RATES.items():
            above, below = (sum(each[key] for each in sums) for key in (part, whole))
            expected = above / below if below else np.nan
            assert summary[name] == pytest.approx(expected, nan_ok=True), name


def test_motions_are_kept_of_as_many_as_wished(lmtr, tiny_home, tiny_config, tmp_path):
    home = tmp_path / "home"
    shutil.copytree(tiny_home, home)
    sets = ("--set", "evaluation.keep_motions=1", "--set", "evaluation.seed=3")
    status, _, err = lmtr("evaluate", "-c", tiny_config, *sets, "--home", home)
    assert status == 0, err
    lake = Lake(Home.open(home, create=False).lake)
    rows = lake.read("rollouts", where="seed = 3").to_pylist()
    by_evaluation = {}
    for row in rows:
        by_evaluation.setdefault(row["evaluation_id"], []).append(len(row["t"]) > 0)
    assert [sum(kept) for kept in by_evaluation.values()] == [1] * len(by_evaluation)
    bare = next(row for row in rows if not row["t"])
    status, _, err = lmtr("show", "rollout", bare["rollout_id"], "--home", home)
    assert status == 2
    assert "without its motion" in err
    out = tmp_path / "rollouts.parquet"
    status, _, err = lmtr("export", "rollouts", "--out", out, "--home", home)
    assert status == 0, err
    exported = pq.read_table(out, columns=["rollout_id"])["rollout_id"].unique().to_pylist()
    assert bare["rollout_id"] not in exported
    assert set(exported) >= {row["rollout_id"] for row in rows if row["t"]}
