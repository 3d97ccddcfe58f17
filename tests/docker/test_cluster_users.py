"""What users type against a cluster of containers, and what it answers."""

import time
from datetime import datetime

import pytest

from tests.docker.conftest import SOLUTIONS, UNDER_WAY
from tests.docker.patience import await_true

pytestmark = [pytest.mark.slow, pytest.mark.cluster]


@pytest.fixture(scope="module")
def configuration(containers, tmp_path_factory):
    """The tests' configuration, on the user's own disk."""
    file = tmp_path_factory.mktemp("user") / "config.toml"
    file.write_text(containers.inside("head", "cat", "/data/config.toml"))
    return str(file)


def test_all_is_well(containers, reference):
    done = containers.lmtr("doctor", "--cluster", "--json")
    assert done.returncode == 0, done.stdout
    assert '"fault"' not in done.stdout.lower()


def test_a_submitted_stage_is_followed_to_its_end(containers, configuration, reference):
    words = ("submit", "generate", "-c", configuration, "--home", "/data/followed")
    typed = time.time()
    done = containers.lmtr(*words)
    submitted = time.time()
    assert done.returncode == 0, done.stderr
    job_id = done.stdout.strip()
    followed = containers.lmtr("logs", job_id, "-f")
    assert followed.returncode == 0, followed.stderr
    assert f"{SOLUTIONS} solved" in followed.stdout
    assert containers.rows("/data/followed") == reference
    asked = "SELECT min(created_at) AS first FROM solutions"
    (row,) = containers.query("/data/followed", asked)
    first = datetime.fromisoformat(row["first"]).timestamp()
    print(
        f"first task solved {first - submitted:.1f} s after submission, {first - typed:.1f} typed"
    )
    assert first - submitted < 15.0


def test_a_cancelled_stage_keeps_what_it_made_and_goes_on(containers, configuration, reference):
    words = ("submit", "generate", "-c", configuration, "--home", "/data/cancelled")
    job_id = containers.lmtr(*words).stdout.strip()
    containers.await_commits("/data/cancelled", UNDER_WAY, job_id)
    done = containers.lmtr("cancel", job_id)
    assert "finished what was under way and stopped" in done.stderr
    assert UNDER_WAY <= len(containers.rows("/data/cancelled")) < SOLUTIONS
    again = containers.lmtr(*words, "--follow")
    assert again.returncode == 0, again.stderr
    assert containers.rows("/data/cancelled") == reference


def test_a_cluster_whose_database_has_another_password_is_mended(containers, reference):
    before = containers.password
    containers.remake("postgres_password")
    assert containers.password != before
    assert containers.runs("generation")
    assert containers.rows("/data/reference") == reference


def test_a_cluster_is_stopped_under_work_and_goes_on(containers, configuration, reference):
    words = ("submit", "generate", "-c", configuration, "--home", "/data/stopped")
    job_id = containers.lmtr(*words).stdout.strip()
    containers.await_commits("/data/stopped", UNDER_WAY, job_id)
    containers.command("down")
    containers.command("up")
    await_true(lambda: containers.alive() == 3, "three nodes")
    assert UNDER_WAY <= len(containers.rows("/data/stopped")) < SOLUTIONS
    again = containers.lmtr(*words, "--follow")
    assert again.returncode == 0, again.stderr
    assert containers.rows("/data/stopped") == reference
