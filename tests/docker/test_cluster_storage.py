"""A cluster of containers whose home lies in an object store that the user has, by settings."""

import pytest
from s3_servers import BUCKET, radosgw_server

from tests.docker.conftest import MODELS

pytestmark = [pytest.mark.slow, pytest.mark.cluster]

HOME = f"s3://{BUCKET}/home"
SOLUTIONS = 40


@pytest.fixture(scope="module")
def store(containers, tmp_path_factory):
    """A real S3 server outside of the cluster, whose keys are a secret of the cluster's."""
    gateway = containers.docker(
        "network", "inspect", "--format", "{{(index .IPAM.Config 0).Gateway}}", containers.network
    ).strip()
    with radosgw_server(tmp_path_factory.mktemp("ceph"), gateway) as server:
        containers.use_store(server.environment)
        yield server
        containers.use_store({})


def test_the_whole_path_with_a_home_in_the_store(containers, store, reference, tmp_path):
    file = tmp_path / "stored.toml"
    file.write_text(containers.inside("head", "cat", "/data/config.toml"))
    options = ("--set", f"dataset.solutions={SOLUTIONS}", "--home", HOME, "--follow")
    done = containers.lmtr("submit", "run", str(file), *options)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr
    assert containers.rows(HOME) == reference[:SOLUTIONS]
    assert len(containers.query(HOME, "SELECT * FROM models")) == len(MODELS)
    keys = store.objects("home/")
    assert "home/home.json" in keys
    assert any(key.startswith("home/models/") for key in keys)
    reports = containers.inside("head", "find", "/data/state", "-name", "*.html")
    assert reports.strip().endswith(".html")


def test_the_doctor_finds_that_the_store_keeps_two_writers_apart(containers, store):
    done = containers.lmtr("doctor", "--cluster", "--home", HOME)
    assert done.returncode == 0, done.stdout
    assert HOME in done.stdout


def test_the_keys_are_told_nowhere(containers, store):
    secret = store.environment["AWS_SECRET_ACCESS_KEY"]
    for name in containers.names():
        assert secret not in containers.docker("inspect", name)
        assert secret not in containers.docker("top", name, "-eo", "pid,args")
        assert secret not in containers.logs(name)
    assert len(containers.rows(HOME)) == SOLUTIONS
