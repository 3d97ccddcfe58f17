"""Bad input ends in one line with cause and mend, exit status 2, and leaves all as it was."""

import pytest

from pipelines.config import load
from services.home import Home


def refused(outcome, *words):
    status, _, err = outcome
    lines = [line for line in err.splitlines() if line.strip()]
    assert status == 2, err
    assert len(lines) == 1, err
    assert "Traceback" not in err
    for word in words:
        assert word in err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--set", "tasks.goal_yav=0.1"], ["tasks.goal_yav", "goal_yaw"]),
        (["--set", "expert.scope.duration=-1"], ["expert.scope.duration", "greater than 0"]),
        (
            ["--set", "tasks.goal_distance=[20.0, 30.0]"],
            ["goal_distance", "bring the goals closer"],
        ),
        (["--solutions", "0"], ["dataset.solutions"]),
        (["--seed", "99999999999999999999999999"], ["dataset.seed", "less than"]),
        (["--set", "training.model.latent=3"], ["training.latent"]),
        (["--set", "training.latent=[100]"], ["latent = 100", "at most 64"]),
        (["--config", "no-such.toml"], ["no-such.toml", "demo"]),
    ],
)
def test_bad_settings_are_refused_before_anything_is_made(lmtr, tmp_path, options, words):
    home = tmp_path / "home"
    refused(lmtr("generate", *options, "--home", home), *words)
    assert not home.exists()


@pytest.mark.parametrize("command", [["query", "SELECT 1"], ["segment"], ["train"], ["report"]])
def test_a_missing_home_says_how_to_make_one(lmtr, tmp_path, command):
    refused(lmtr(*command, "--home", tmp_path / "none"), "none", "lmtr run demo")


def test_a_home_that_is_a_file_is_left_alone(lmtr, tmp_path):
    path = tmp_path / "file"
    path.write_text("precious")
    refused(lmtr("generate", "--home", path), str(path))
    assert path.read_text() == "precious"


def test_a_folder_of_somebody_else_is_left_alone(lmtr, tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    refused(lmtr("generate", "--home", tmp_path), str(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize(
    ("sql", "words"),
    [
        ("SELECT * FROM footsteps", ["footsteps", "solutions"]),
        ("SELECT cosst FROM solutions", ["cosst", "cost"]),
        ("SELEC 1", ["SELEC"]),
        ("DROP TABLE solutions", ["must only read"]),
        ("COPY solutions TO 'x.csv'", ["must only read"]),
    ],
)
def test_bad_queries(lmtr, tiny_home, sql, words):
    refused(lmtr("query", sql, "--home", tiny_home), *words)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["show", "solution", "999"], ["999", "--solutions 1000"]),
        (["show", "solution", "first"], ["first", "index"]),
        (["show", "rollout", "none"], ["none", "rollout_id"]),
        (["show", "solution", "0", "--format", "avi"], ["avi"]),
        (["segment", "--dataset", "other"], ["other", "tiny-s5"]),
        (["train", "--latent", "-1"], ["training.latent"]),
        (["train", "--latent", "three"], ["training.latent"]),
        (["show", "solution", "0", "--out", "/proc/x"], ["/proc/x", "--out"]),
        (["ui", "--port", "999999"], ["--port"]),
        (["generate", "--bogus"], ["--bogus", "--help"]),
        (["export", "solutions", "--out", "/proc/x.parquet"], ["/proc/x.parquet"]),
        (["export", "segments", "--out", "y.parquet", "--where", "tau >"], ["syntax error"]),
        (
            ["evaluate", "--set", "evaluation.weights=[[1, 2]]"],
            ["evaluation.weights", "4 numbers (chi_base, chi_feet, eta, gamma), got 2: [1, 2]"],
        ),
        (
            ["evaluate", "--set", "evaluation.weights=[1, 1, 5, 0.5]"],
            ["evaluation.weights", "another pair of brackets"],
        ),
    ],
)
def test_bad_arguments_of_commands(lmtr, tiny_home, command, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused(lmtr(*command, "--home", tiny_home), *words)
    assert list(tmp_path.iterdir()) == []


def test_a_table_that_is_not_there_names_the_command_that_makes_it(lmtr, tiny_config, tmp_path):
    home = tmp_path / "home"
    assert lmtr("generate", "-c", tiny_config, "--solutions", 1, "--home", home)[0] == 0
    refused(lmtr("train", "--home", home), "segments", "lmtr segment")


def test_a_second_driver_on_the_same_data_set_is_told_so(lmtr, tiny_home, tiny_config):
    dataset_id = load(str(tiny_config)).dataset_id
    with Home.open(tiny_home, create=False).lock(f"generate-{dataset_id}"):
        refused(lmtr("generate", "-c", tiny_config, "--home", tiny_home), dataset_id)


def test_the_home_may_stand_before_the_command_or_in_the_environment(lmtr, tiny_home, monkeypatch):
    sql = "SELECT count(*) AS n FROM solutions"
    before = lmtr("--home", tiny_home, "query", sql, "--format", "csv")
    monkeypatch.setenv("LMTR_HOME", str(tiny_home))
    assert before == lmtr("query", sql, "--format", "csv") == (0, before[1], before[2])
    assert before[1].split() == ["n", "6"]
