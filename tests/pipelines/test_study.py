"""Studies: variants of a configuration, checked together and carried out by one command."""

import json
import shutil

import pytest

from lmtr.errors import ConfigurationError
from pipelines.config import builtin_names, load
from pipelines.stage_times import StageTimes
from pipelines.study import load_study, load_variant
from services.home import Home
from services.lake.tables import Lake

VARIANTS = """
[[variants]]
name = "plain"
training.mirror = false

[[variants]]
name = "little"
[variants.training]
latent = [2]
segments = 20
[variants.training.model]
kappa = 0.01
"""


@pytest.fixture(scope="module")
def study_file(tiny_config):
    path = tiny_config.with_name("study.toml")
    path.write_text(tiny_config.read_text() + VARIANTS)
    return path


def test_a_variant_differs_in_what_it_names_alone(study_file):
    study = load_study(str(study_file))
    assert study.name == "study"
    assert list(study.configurations) == ["base", "plain", "little"]
    assert study.base == load(str(study_file))
    plain, little = study.variants.values()
    assert plain == study.base.model_copy(
        update={"training": study.base.training.model_copy(update={"mirror": False})}
    )
    assert (little.training.latent, little.training.segments) == ((2,), 20)
    assert little.training.optimizer == study.base.training.optimizer
    assert little.dataset_id == study.base.dataset_id


def test_overrides_hold_for_variants_that_do_not_set_the_same(study_file):
    study = load_study(str(study_file), ["training.latent=[0]", "dataset.seed=9"])
    assert [c.training.latent for c in study.configurations.values()] == [(0,), (0,), (2,)]
    assert {c.dataset.seed for c in study.configurations.values()} == {9}


def test_a_variant_can_do_without_the_tuning(tmp_path):
    path = tmp_path / "tuned.toml"
    path.write_text(
        "[evaluation.tuning]\nseed = 3\n[[variants]]\nname = 'not'\nevaluation.tuning = false\n"
    )
    study = load_study(str(path))
    assert study.base.evaluation.tuning is not None
    assert study.configurations["not"].evaluation.tuning is None


def test_one_variant_can_be_chosen(study_file):
    assert load_variant(str(study_file), [], "little").training.segments == 20
    assert load_variant(str(study_file), [], None) == load(str(study_file))
    with pytest.raises(ConfigurationError, match=r"no variant 'lots'; choose one of base, plain"):
        load_variant(str(study_file), [], "lots")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[[variants]]\ntraining.mirror = false", r"every variant needs a name"),
        ('[[variants]]\nname = "base"', r"got 'base' twice"),
        ('[[variants]]\nname = "a"\n[[variants]]\nname = "a"', r"got 'a' twice"),
        ("[variants]\nmirror = false", r"begun with \[\[variants\]\]"),
        (
            '[[variants]]\nname = "deep"\ntraining.latent = [-1]',
            r"^variant 'deep': configuration: training.latent.0: .*got -1",
        ),
        ('[[variants]]\nname = "typo"\ntrainings.mirror = false', r"did you mean 'training'\?"),
    ],
)
def test_faulty_variants_are_refused_before_any_work(tmp_path, lmtr, text, says):
    path = tmp_path / "faulty.toml"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=says):
        load_study(str(path))
    status, _, err = lmtr("run", path, "--home", tmp_path / "home")
    assert (status, err.count("\n")) == (2, 1)
    assert not (tmp_path / "home").exists()


def test_all_built_in_configurations_can_be_carried_out():
    for name in builtin_names():
        assert load_study(name).name == name


@pytest.mark.slow
def test_a_study_makes_every_variant_and_times_its_stages(lmtr, study_file, tiny_home, tmp_path):
    home = tmp_path / "home"
    shutil.copytree(tiny_home, home)
    status, _, err = lmtr("run", study_file, "--home", home)
    assert status == 0, err
    lake = Lake(Home.open(home, create=False).lake)
    assert lake.query_value("SELECT count(*) FROM datasets") == 1
    assert lake.query_value("SELECT count(*) FROM models") == 2 + 2 + 1
    kappas = lake.query_value(
        "SELECT list(DISTINCT (settings->>'$.model.kappa')::DOUBLE) FROM models"
    )
    assert sorted(kappas) == [0.001, 0.01]
    seconds = json.loads((home / "reports" / "study" / "stages.json").read_text())
    assert set(seconds) == {"base", "plain", "little"}
    assert set(seconds["little"]["seconds"]) == {"generate", "segment", "train", "evaluate"}
    assert "most in" in err


def test_stage_times_add_up_over_runs(tmp_path):
    path, digests = tmp_path / "deep" / "stages.json", {"base": "a1", "other": "b2"}
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt), StageTimes(path, digests).of("base", "train"):
            raise KeyboardInterrupt
    with StageTimes(path, digests).of("base", "report"):
        pass
    kept = StageTimes(path, digests).seconds["base"]
    assert set(kept) == {"train", "report"}
    assert kept["train"] > 0.0
    # Other settings of the same name took nothing yet.
    assert StageTimes(path, {"base": "c3"}).seconds == {}
    path.write_text("{")
    assert StageTimes(path, digests).seconds == {}
