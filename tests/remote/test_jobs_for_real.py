"""What users type against a Ray head with a token, and what becomes of their rows."""

import json
import re
import time

import pytest
from ray_head import RayHead

from pipelines.remote import submission as module
from pipelines.remote import versions
from pipelines.remote.target import Target
from pipelines.remote.versions import Versions
from services.cluster.head import Head
from services.cluster.jobs import Jobs, JobStatus
from services.cluster.token import Token
from services.errors import JobExistsError
from tests.faults.driver import PATIENCE_S, committed, require_complete, require_one_line, rows
from tests.remote.conftest import COUNT, await_rows, interrupted

pytestmark = [pytest.mark.slow, pytest.mark.cluster]


def listed_jobs(head: RayHead) -> list:
    return Jobs(Head(head.url, Token.read(head.token_file))).list()


def test_a_submitted_generation_is_followed_to_its_end_and_its_rows_are_there(
    user, cluster_home, reference
):
    done = user.types("submit", "generate", "-c", "walks.toml", "-n", 8, "--follow")
    assert done.returncode == 0, done.stderr
    job_id, *log = done.stdout.splitlines()
    assert re.fullmatch(r"generate-walks-\d{8}-\d{6}", job_id)
    assert any("generate --config walks.toml --solutions 8" in line for line in log)
    assert re.search(rf"job {job_id} succeeded after \d", done.stderr)
    assert f"lmtr cancel {job_id}" in done.stderr
    made = rows(cluster_home)
    assert made["digest"].to_pylist() == reference["digest"].to_pylist()[:8]
    job = user.job(job_id)
    assert (job["stage"], job["status"], job["configuration"]) == ("generate", "succeeded", "walks")
    assert job["dataset_id"] == log[-1]  # what `lmtr generate` prints at its end
    assert job["duration_s"] > 0
    assert user.types("logs", job_id).stdout.splitlines() == log
    assert user.types("logs", job_id, "-n", 1).stdout.splitlines() == log[-1:]
    shown = user.types("jobs").stdout
    assert re.search(rf"{job_id}\s+generate\s+succeeded", shown)
    assert "versions-" not in shown
    assert "versions-" in user.types("jobs", "--all").stdout


def test_cancelling_drains_and_the_same_submission_completes_the_data_set(
    user, cluster_home, reference
):
    before = committed(cluster_home)
    job_id = user.submits("generate", "-c", "walks.toml")
    await_rows(cluster_home, before + 4)
    cancelled = user.types("cancel", job_id)
    assert cancelled.returncode == 0, cancelled.stderr
    assert f"job {job_id} finished what was under way and stopped" in cancelled.stderr
    told = re.search(rf"stopped with (\d+) of {COUNT} solutions", cancelled.stderr)
    assert told, cancelled.stderr
    assert before < int(told[1]) == len(rows(cluster_home)) < COUNT
    assert "to go on: lmtr submit generate -c walks.toml" in cancelled.stderr
    assert user.job(job_id)["status"] == "stopped"
    assert "had ended already: stopped" in user.types("cancel", job_id).stderr

    again = user.types("submit", "generate", "-c", "walks.toml", "-f")
    assert again.returncode == 0, again.stderr
    require_complete(cluster_home, reference)


def test_leaving_a_log_leaves_the_job_running_and_the_status_tells_of_it(user, tmp_path):
    home = tmp_path / "another"
    more = ("-n", 5000, "--home", home)
    job_id = user.submits("generate", "-c", "walks.toml", *more)
    following = user.starts("logs", job_id, "-f")
    assert any(line.startswith("Solving tasks: ") for line in following.stdout)
    status, err = interrupted(following)
    assert status == 130
    assert f"job {job_id} goes on without you" in err
    shown = user.types("status").stdout
    assert re.search(rf"{job_id}.*\d+ of 5000\s+Solving tasks", shown), shown
    assert re.search(r"\(head\).*alive.*[?\d] of 2", shown), shown
    assert user.job(job_id)["status"] == "running"
    assert user.types("cancel", job_id).returncode == 0


def test_a_job_that_fails_says_why_in_the_clients_last_line(user):
    done = user.types("submit", "segment", "-d", "walks-s0-00000000", "-f")
    assert done.returncode == 2
    require_one_line(done.stderr, "failed after", "walks-s0-00000000", "lmtr submit segment")


def test_jobs_of_one_second_have_ids_of_their_own(user, monkeypatch, head):
    monkeypatch.setattr(module, "job_name", lambda stage, name: "results-same-name")
    target = Target(Jobs(Head(head.url, Token.read(head.token_file))), "/nowhere/at/all")
    submission = module.Submission("lake", ("ls",), None, "--config", "", "lmtr lake ls")
    ids = [module.submit(submission, target) for _ in range(2)]
    assert ids == ["results-same-name", "results-same-name-2"]
    with pytest.raises(JobExistsError, match="choose another id"):
        target.jobs.submit("results-same-name", "true", {})
    assert target.jobs.await_end(ids[1], PATIENCE_S).status is JobStatus.FAILED


def test_a_job_that_is_only_begun_can_be_cancelled(user):
    job_id = user.submits("generate", "-c", "walks.toml", "--set", "dataset.seed=77")
    cancelled = user.types("cancel", job_id)
    assert cancelled.returncode == 0, cancelled.stderr
    assert re.search(r"stopped|ended by force or before its work began", cancelled.stderr)
    assert user.job(job_id)["status"] == "stopped"


def test_a_job_that_does_not_stop_in_time_is_told_from_one_that_drained(head, lmtr_here):
    jobs = Jobs(Head(head.url, Token.read(head.token_file)))
    environment = {"RAY_JOB_STOP_WAIT_TIME_S": "1"}
    stubborn = "trap '' TERM; echo begun; while :; do sleep 0.2; done"
    jobs.submit("stubborn", stubborn, {"lmtr.stage": "generate"}, environment=environment)
    until = time.monotonic() + PATIENCE_S
    while "begun" not in jobs.log("stubborn").splitlines() and time.monotonic() < until:
        time.sleep(0.2)
    _, _, err = lmtr_here("cancel", "stubborn")
    assert "was ended by force" in err


@pytest.mark.parametrize(
    ("mine", "named"),
    [
        ({"lmtr": "9.9"}, "LMTR 0.1.0 where this client has 9.9"),
        ({"ray": "2.1.0"}, "Ray 2.60.0 where this client has 2.1.0"),
    ],
)
def test_other_versions_are_refused_before_anything_is_submitted(
    head, user, monkeypatch, lmtr_here, mine, named
):
    ours = Versions.here().model_copy(update=mine)
    monkeypatch.setattr(Versions, "here", classmethod(lambda cls: ours))
    before = [job.id for job in listed_jobs(head) if job.noted("lmtr.stage")]
    words = ("submit", "generate", "-c", user.folder / "walks.toml", "-n", 1)
    status, _, err = lmtr_here(*words)
    assert status == 2
    require_one_line(err, named, "--any-version", "image")
    assert [job.id for job in listed_jobs(head) if job.noted("lmtr.stage")] == before
    status, out, err = lmtr_here(*words, "--any-version")
    assert status == 0
    assert "warning: " in err
    assert out.strip() in [job.id for job in listed_jobs(head)]
    assert lmtr_here("cancel", out.strip())[0] == 0


def test_a_cluster_without_lmtr_is_refused(head, user, monkeypatch, lmtr_here):
    monkeypatch.setattr(versions, "FRESH_S", -1.0)
    monkeypatch.setattr(versions, "ASK", "lmtr-is-not-here versions")
    status, _, err = lmtr_here("submit", "generate", "-c", user.folder / "walks.toml")
    assert status == 2
    require_one_line(err, "does not tell its version of LMTR", "not on the PATH", "image")


def test_the_token_is_asked_for_and_never_shown(head, user, tmp_path):
    none = {**user.environment, "LMTR_SETTINGS": str(tmp_path / "none.toml")}
    wrong = tmp_path / "wrong"
    wrong.write_text("0" * 64)
    for command in (
        ("jobs",),
        ("logs", "any"),
        ("logs", "any", "-f"),
        ("status",),
        ("cancel", "any"),
    ):
        words = (*command, "--cluster", head.url)
        done = type(user)(tmp_path, none).types(*words)
        assert done.returncode == 2
        require_one_line(done.stderr, head.url, "wants a token", "RAY_AUTH_TOKEN_PATH")
    environment = {**none, "RAY_AUTH_TOKEN_PATH": str(wrong)}
    done = type(user)(tmp_path, environment).types("jobs", "--cluster", head.url)
    assert done.returncode == 2
    require_one_line(done.stderr, f"refuses the token from {wrong}", "earlier start")
    assert "0" * 64 not in done.stderr
    submitted = type(user)(user.folder, environment).types(
        "submit", "generate", "-c", "walks.toml", "--cluster", head.url
    )
    require_one_line(submitted.stderr, "refuses the token")
    told = json.dumps([job.model_dump(mode="json") for job in listed_jobs(head)])
    assert head.token_file.read_text() not in told


def test_an_unknown_job_is_told(user):
    for words in (("logs", "nobody"), ("logs", "nobody", "-f"), ("cancel", "nobody")):
        done = user.types(*words)
        assert done.returncode == 2
        require_one_line(done.stderr, "knows no job 'nobody'", "lmtr jobs")
