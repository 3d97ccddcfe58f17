"""What is sent to a cluster for what was typed, and what is refused before anything is sent."""

import io
import json
import re
import shlex
import socket
import subprocess
import sys
from datetime import timedelta

import pytest
from rich.console import Console

from pipelines.progress import Progressed
from pipelines.remote import submission as module
from pipelines.remote.tables import latest_progress
from pipelines.remote.target import find_target
from pipelines.remote.versions import Versions, remarks, require_same
from pipelines.remote.watch import LogView, spoken
from services.errors import ClusterError, ProfileError


@pytest.fixture(autouse=True)
def settings(monkeypatch, tmp_path):
    """A user whose default profile is a cluster that nobody runs, on a port that nobody has."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{probe.getsockname()[1]}"
    for name in ("RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH", "LMTR_PROFILE"):
        monkeypatch.delenv(name, raising=False)
    file = tmp_path / "settings.toml"
    file.write_text(
        f'profile = "off"\n[profiles.off]\ncluster = "{url}"\nhome = "/data/home"\n'
        f'token_file = "{tmp_path / "token"}"\n[profiles.bare]\ncluster = "http://127.0.0.1:9"\n'
    )
    (tmp_path / "token").write_text("secret-of-the-profile")
    monkeypatch.setenv("LMTR_SETTINGS", str(file))
    monkeypatch.setenv("LMTR_HOME", "/home/of/this/machine")
    return file


@pytest.fixture
def sent(lmtr, monkeypatch):
    """What `lmtr submit` would send for some words: the submission and its target."""
    caught = []

    def keep(submission, target, *, any_version):
        caught.append((submission, target, any_version))
        return "the-id"

    monkeypatch.setattr(module, "submit", keep)

    def typed(*words):
        status, out, err = lmtr(*words)
        assert status == 0, err
        assert out == "the-id\n"
        return caught[-1]

    return typed


def test_a_stage_is_sent_with_the_words_that_were_typed(sent, tiny_config):
    words = ("-n", 40, "--set", "expert.obstacle_weight=7.0", "--again", "error")
    submission, target, any_version = sent("submit", "generate", "-c", tiny_config, *words)
    assert submission.entrypoint(target.home) == (
        "lmtr --home /data/home generate --config tiny.toml --solutions 40 --again error "
        "--set expert.obstacle_weight=7.0 --set cluster.address=auto"
    )
    assert submission.files() == {"tiny.toml": tiny_config.read_text()}
    assert re.fullmatch(r"tiny-s5-[0-9a-f]{8}", submission.dataset_id)
    assert shlex.split(submission.command)[:3] == ["lmtr", "submit", "generate"]
    assert not any_version


def test_a_study_keeps_its_name_and_flags_their_sense(sent):
    submission, target, any_version = sent(
        *("submit", "results", "demo", "--no-films", "--home", "s3://bucket/x", "--any-version")
    )
    assert submission.entrypoint(target.home) == (
        "lmtr --home s3://bucket/x results demo.toml --no-films --set cluster.address=auto"
    )
    assert "[dataset]" in submission.files()["demo.toml"]
    assert any_version


def test_without_a_home_the_clusters_own_is_taken_and_never_this_machines(sent, tiny_config):
    submission, target, _ = sent("--profile", "bare", "submit", "segment", "-d", "tiny-s5-1")
    assert submission.entrypoint(target.home) == (
        "lmtr segment --dataset tiny-s5-1 --set cluster.address=auto"
    )
    assert submission.files() == {}
    assert submission.dataset_id == "tiny-s5-1"
    assert target.command("jobs") == "lmtr jobs --profile bare"


def test_words_reach_the_clusters_shell_as_they_were_typed(sent, tmp_path):
    odd = tmp_path / "it's; a $(test).toml"
    odd.write_text('[dataset]\nname = "odd"\n')
    submission, _, _ = sent("submit", "train", "-c", odd, "--set", "cluster.cache='/a b'")
    entrypoint = submission.entrypoint("/data/home")
    echoed = entrypoint.replace("lmtr", f"{sys.executable} -c 'import sys; print(sys.argv[1:])'", 1)
    heard = subprocess.run(echoed, shell=True, capture_output=True, text=True, check=True).stdout
    assert heard.strip() == str(shlex.split(entrypoint)[1:])
    assert submission.file in shlex.split(entrypoint)
    assert re.fullmatch(r"train-it-s-a-test-\d{8}-\d{6}", module.job_name("train", submission.name))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("generate", "-n", 0), "dataset.solutions"),
        (("generate", "--set", "dataset.solution=3"), "did you mean 'solutions'?"),
        (("train", "--latent", "x"), "training.latent"),
        (("evaluate", "--rollouts", "-3"), "evaluation.rollouts"),
        (("run", "nowhere.toml"), "neither a file nor built in"),
        (("generate", "-c", "demo", "--variant", "none"), "it has no variant 'none'"),
        (("generate", "--home", "relative/home"), "must be an absolute folder"),
        (("generate", "--cluster", "head:8265"), "must be an address like http"),
        (("generate",), "cannot be reached"),
    ],
)
def test_what_is_wrong_is_told_before_anything_is_sent(lmtr, words, said):
    status, out, err = lmtr("submit", *words)
    assert (status, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "words", [("jobs",), ("status",), ("logs", "x"), ("logs", "x", "-f"), ("cancel", "x")]
)
def test_a_cluster_that_is_off_is_told_in_one_line(lmtr, words):
    status, out, err = lmtr(*words)
    assert (status, out) == (2, "")
    assert re.match(r"lmtr: cluster http://127.0.0.1:\d+: it cannot be reached", err)
    assert err.count("\n") == 1


def test_profile_slips_are_told(lmtr, settings):
    status, _, err = lmtr("--profile", "of", "jobs")
    assert status == 2
    assert "profile 'of' is not in" in err
    assert "choose one of: off, bare" in err
    settings.write_text("")
    status, _, err = lmtr("jobs")
    assert status == 2
    assert "no cluster is named; give --cluster" in err
    assert str(settings) in err


def test_the_token_of_a_profile_goes_to_no_other_cluster():
    def token(target):
        return target.jobs.head.token

    assert token(find_target()).value == "secret-of-the-profile"
    assert token(find_target(cluster="http://other:8265")) is None
    both = find_target("off", "http://tunnel:8265")
    assert both.url == "http://tunnel:8265"
    assert token(both).value == "secret-of-the-profile"
    with pytest.raises(ProfileError, match="home 'x' of a job"):
        find_target(home="x")


def test_other_versions_of_lmtr_and_ray_are_refused_and_of_python_remarked():
    ours = Versions(lmtr="1.0", code="1.0", ray="2.60.0", python="3.11.7")
    require_same(ours, ours.model_copy(update={"python": "3.11.2", "code": "1.0+ab"}), "here")
    theirs = ours.model_copy(update={"python": "3.12.7", "lmtr": "1.1"})
    with pytest.raises(ClusterError) as caught:
        require_same(ours, theirs, "http://there")
    assert "LMTR 1.1 where this client has 1.0" in str(caught.value)
    assert "Python" not in str(caught.value)
    assert remarks(ours, theirs) == ["Python 3.12 where this client has 3.11"]
    assert "Ray 2" not in str(caught.value)
    assert "lmtr==1.1" in str(caught.value)


def test_the_versions_that_a_job_tells_are_read_back(lmtr):
    status, out, _ = lmtr("versions")
    assert status == 0
    assert Versions.model_validate_json(out) == Versions.here()
    assert json.loads(out)["home"] == "/home/of/this/machine"


@pytest.mark.parametrize("total", [None, 64])
@pytest.mark.parametrize("words", ["", "1.0/s, 50% accepted"])
def test_progress_is_read_as_it_was_written(total, words):
    line = Progressed("Solving tasks", 7, total, words)
    assert Progressed.read(str(line)) == line


@pytest.mark.parametrize(
    "line",
    ["", "generate: demo-s0: 3 solved in 2 s", "lmtr: it failed", "Solving tasks", "a: 1/2x"],
)
def test_other_lines_are_no_progress(line):
    assert Progressed.read(line) is None


def test_the_latest_progress_of_a_log_is_found():
    log = "Running\nSolving tasks: 1/64 x\nSolving tasks: 9/64 0.1/s\ngenerate: done\n"
    assert latest_progress(log) == Progressed("Solving tasks", 9, 64, "0.1/s")
    assert latest_progress("nothing yet\n") is None


LOG = ("Running", "Solving tasks: 1/64 0.1/s", "Solving tasks: 9/64 0.2/s", "done [not markup]")


def shown(terminal: bool) -> str:
    file = io.StringIO()
    console = Console(file=file, force_terminal=terminal, width=60, highlight=False)
    with LogView(console) as view:
        for line in LOG:
            view.line(line)
    return file.getvalue()


def test_what_would_steer_the_terminal_is_written_out():
    steering = "a\x1b]52;c;ZXZpbA==\x07b\x1b[2J\x9b2J\ttab \x1b[31mred\x1b[0m"
    file = io.StringIO()
    with LogView(Console(file=file, width=200, highlight=False)) as view:
        view.line(steering)
    written = file.getvalue()
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", written)
    assert r"\x1b[2J" in written
    assert written.endswith("red\n")


def test_a_log_in_a_file_keeps_every_line():
    assert shown(terminal=False).splitlines() == list(LOG)


def test_a_log_in_a_terminal_has_progress_in_one_place():
    lines = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]|\r", "", shown(terminal=True)).splitlines()
    assert lines.index("Running") < lines.index("done [not markup]")
    assert not any("1/64" in line and "9/64" in line for line in lines)
    # What stays when the last frame is wiped is the text alone.
    final = shown(terminal=True).rpartition("done [not markup]")[2]
    assert "Solving tasks: 9/64 0.2/s" in final
    assert "1/64" not in final


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(0.4, "0 s"), (61, "1 min 1 s"), (7260, "2 h 1 min"), (180000, "2 d 2 h")],
)
def test_durations_are_spoken(seconds, said):
    assert spoken(timedelta(seconds=seconds)) == said
    assert spoken(None) == "?"
