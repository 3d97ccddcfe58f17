"""What decides what a cluster of containers is, and what is kept of it for later starts."""

import os
import subprocess

import cluster_settings
import compose_client
import pytest
from cluster_settings import ClusterSettings, Wishes
from compose_client import Engine, ToolError, engine_of
from compose_settings import Dotenv, keep

ENGINE = Engine("28.0.1", 8)
FOUND = {"LMTR_UID": "1000", "LMTR_SECRETS_STATE": "00000000"}


@pytest.fixture
def start(monkeypatch, tmp_path):
    """Starts a cluster as far as its settings go; returns them."""
    monkeypatch.setattr(cluster_settings, "HERE", tmp_path)
    for name in [name for name in os.environ if name.startswith(("LMTR_", "COMPOSE_"))]:
        monkeypatch.delenv(name)

    def started(environment=None, engine=ENGINE, **wishes):
        with monkeypatch.context() as patched:
            for name, value in (environment or {}).items():
                patched.setenv(name, value)
            settings = ClusterSettings(Wishes(**wishes))
            settings.keep(engine, **FOUND)
        return settings

    return started


def kept(settings):
    """What a start by hand finds."""
    said = Dotenv.of(settings.dotenv)
    return {**said.kept, **said.own}


def test_what_was_set_once_stays(start):
    start({"LMTR_DASHBOARD_PORT": "9265", "LMTR_HEAD_MEMORY": "6g"}, workers=4)
    settings = start()
    assert settings.head == "http://127.0.0.1:9265"
    assert kept(settings)["LMTR_WORKERS"] == "4"
    assert kept(settings)["LMTR_HEAD_MEMORY"] == "6g"


def test_workers_share_the_processors_and_have_memory_for_their_solvers(start):
    for workers, cpus, limit, memory in ((2, "4", "4.5", "3072m"), (1, "8", "8", "4096m")):
        found = kept(start(workers=workers))
        shares = [found[f"LMTR_WORKER_{name}"] for name in ("CPUS", "CPU_LIMIT", "MEMORY")]
        assert shares == [cpus, limit, memory]


def test_what_is_typed_outranks_the_environment_the_users_lines_and_what_is_kept(start):
    file = start(cpus=1).dotenv
    with file.open("a") as lines:
        lines.write("LMTR_WORKER_CPUS=3 # of 8\n")
    by_line = start()
    assert by_line.values["LMTR_WORKER_CPUS"] == "3"
    assert kept(by_line)["LMTR_WORKER_CPU_LIMIT"] == "3.5"
    assert start({"LMTR_WORKER_CPUS": "2"}).values["LMTR_WORKER_CPUS"] == "2"
    typed = start({"LMTR_WORKER_CPUS": "2"}, cpus=4)
    assert typed.environment["LMTR_WORKER_CPUS"] == "4"
    assert Dotenv.of(file).own == {"LMTR_WORKER_CPUS": "3"}


def test_an_engine_that_cannot_limit_processors_is_not_asked_to(start):
    settings = start(engine=Engine("28.0.1", 8, shares_processors=False))
    assert kept(settings)["LMTR_WORKER_CPU_LIMIT"] == "0"


def test_object_storage_stays_until_it_is_not_wanted(start):
    assert start().home == "/data/home"
    for wishes in ({"storage": True}, {}):
        settings = start(**wishes)
        assert (settings.has_storage, settings.home) == (True, "s3://lmtr/home")
        assert kept(settings)["COMPOSE_PROFILES"] == "storage"
    settings = start(storage=False)
    assert (settings.has_storage, settings.home) == (False, "/data/home")
    assert start().home == "/data/home"


@pytest.mark.parametrize("home", ["s3://mine/home", "s3://lmtr/home", "/data/home", "/data/x"])
@pytest.mark.parametrize("storage", [True, False])
def test_a_home_of_the_users_own_is_what_everybody_is_told(start, home, storage):
    settings = start({"LMTR_CLUSTER_HOME": home}, storage=storage)
    told = (settings.environment["LMTR_CLUSTER_HOME"], kept(settings)["LMTR_CLUSTER_HOME"])
    assert (settings.home, *told) == (home, home, home)
    assert start().home == home


def test_what_compose_is_told_is_what_was_found(start):
    settings = start({"LMTR_UID": "77", "LMTR_DASHBOARD_PORT": ""})
    assert settings.environment["LMTR_UID"] == kept(settings)["LMTR_UID"] == FOUND["LMTR_UID"]
    assert settings.head == "http://127.0.0.1:8265"


def test_a_second_cluster_has_a_file_and_secrets_of_its_own(start):
    first = start()
    before = first.dotenv.read_bytes()
    second = start(name="second")
    assert (first.profile, second.profile) == ("local", "second")
    assert second.dotenv.name == ".env.second"
    assert kept(second)["LMTR_SECRETS"] == "./secrets-second"
    assert first.secrets != second.secrets
    assert first.dotenv.read_bytes() == before
    assert start({"COMPOSE_PROJECT_NAME": "second"}).dotenv == second.dotenv


def test_the_users_lines_stay_wherever_they_are(start):
    file = start().dotenv
    file.write_text(f"# mine\nA=1\n{file.read_text()}B=2\n")
    start(workers=3)
    said = Dotenv.of(file)
    assert said.own == {"A": "1", "B": "2"}
    assert said.kept["LMTR_WORKERS"] == "3"
    assert "# mine" in file.read_text().splitlines()


def test_compose_reads_what_is_kept_as_we_do(start, tmp_path):
    try:
        compose = compose_client.compose_command(compose_client.docker_client())
    except ToolError as error:
        pytest.skip(str(error))
    values = {"A": "a b # c", "B": "", "C": 'd"e', "D": "/f/g.h:i"}
    lines = "E=5 # of 8\nexport F='six'\nG=\"7 # 7\"\n#H=8\nA=mine\n"
    file, services = tmp_path / "dotenv", tmp_path / "compose.yaml"
    file.write_text(lines)
    keep(file, values)
    said = Dotenv.of(file)
    ours = {**said.kept, **said.own}
    wanted = "".join(f"      - '{name}=<${{{name}}}>'\n" for name in ours)
    services.write_text(f"services:\n  one:\n    image: none\n    environment:\n{wanted}")
    command = [*compose, "--env-file", str(file), "--file", str(services), "config"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert ours == {**values, "A": "mine", "E": "5", "F": "six", "G": "7 # 7"}
    for value in ours.values():
        assert f"<{value}>" in done.stdout


def test_a_value_that_cannot_be_written_is_refused(start):
    with pytest.raises(ValueError, match="LMTR_HEAD_MEMORY"):
        start({"LMTR_HEAD_MEMORY": "it's"})


@pytest.mark.parametrize("wishes", [{"workers": 0}, {"cpus": -1}, {"name": "A b"}])
def test_an_impossible_cluster_is_refused(start, wishes):
    with pytest.raises(ValueError, match=r"at least one|no name"):
        start(**wishes)


@pytest.mark.parametrize("setting", ["LMTR_WORKERS=0", "LMTR_WORKER_CPUS=2.5", "LMTR_WORKERS=x"])
def test_an_impossible_number_is_refused_by_its_name(start, setting):
    name, value = setting.split("=")
    with pytest.raises(ValueError, match=setting):
        start({name: value})


@pytest.mark.parametrize(
    "told",
    [
        "",
        '{"ServerErrors": ["Cannot connect to the Docker daemon"], "ClientInfo": {}}',
        '{"ServerVersion": "", "NCPU": 0}',
    ],
)
def test_a_client_without_an_engine_is_told_as_that_whatever_its_status(told):
    with pytest.raises(ToolError, match=r"no Docker engine answers \(.*Cannot connect.*\); start"):
        engine_of(told, "Cannot connect to the Docker daemon")


def test_an_engine_is_known_by_what_it_says():
    told = '{"ServerVersion": "20.10.24", "NCPU": 2, "CpuCfsQuota": false}'
    assert engine_of(told) == Engine("20.10.24", 2, shares_processors=False)
    assert engine_of(told).leaks_loopback
    assert not ENGINE.leaks_loopback
