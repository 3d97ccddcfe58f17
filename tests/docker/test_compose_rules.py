"""What every service of the Compose file must keep to, and what images may be made of."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml
from requirements import requirements

from lmtr import __version__
from services.cluster.ray_cluster import HEALTH

DOCKER = Path(__file__).resolve().parents[2] / "docker"
COMPOSE = yaml.safe_load((DOCKER / "compose.yaml").read_text())
ONCE = {"storage-volume"}
"""Services that end when their work is done."""

SERVICES = sorted(set(COMPOSE["services"]) - ONCE)


def default(text):
    """What a text says where no variable is set."""
    return re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", str(text))


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_is_watched_limited_and_started_again(name):
    service = COMPOSE["services"][name]
    assert service["restart"] == "unless-stopped"
    assert service["healthcheck"]["test"][0] == "CMD"
    assert re.fullmatch(r"\d+g", default(service["mem_limit"]))
    assert service["pids_limit"]
    assert service["stop_grace_period"] if name != "storage" else True


@pytest.mark.parametrize("name", sorted(COMPOSE["services"]))
def test_a_service_cannot_gain_rights_or_change_its_image(name):
    service = COMPOSE["services"][name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert default(service["user"]) == "10001:0"
    assert "privileged" not in service


@pytest.mark.parametrize("name", sorted(COMPOSE["services"]))
def test_images_are_of_one_version(name):
    image, _, tag = default(COMPOSE["services"][name]["image"]).rpartition(":")
    assert re.search(r"\d+\.\d+|\d{4}-\d\d-\d\d", tag), tag
    if image.startswith("lmtr-"):
        assert tag == __version__


def test_ports_are_published_to_this_machine_alone():
    ports = [port for each in COMPOSE["services"].values() for port in each.get("ports", ())]
    assert len(ports) == 2
    assert all(default(port).startswith("127.0.0.1:") for port in ports)


def test_the_database_is_seen_by_the_tracking_server_alone():
    seen = {name for name, each in COMPOSE["services"].items() if "storage" in each["networks"]}
    assert seen == {"database", "tracking"}
    assert COMPOSE["networks"]["storage"] == {"internal": True}


def test_no_secret_is_in_the_file():
    for name, service in COMPOSE["services"].items():
        for key, value in service.get("environment", {}).items():
            secret = re.search(r"TOKEN|PASSWORD|SECRET|KEY", key)
            assert not secret or str(value).startswith("/run/secrets/"), (name, key)


def test_nodes_have_what_every_process_of_a_cluster_must_have():
    text = (DOCKER / "Dockerfile").read_text()
    for name, value in HEALTH.items():
        assert f"{name}={value}" in text


def test_images_are_made_of_what_is_named_alone():
    lines = [
        line
        for line in (DOCKER.parent / ".dockerignore").read_text().splitlines()
        if line and not line.startswith("#")
    ]
    assert lines[0] == "*"
    allowed = {line[1:] for line in lines if line.startswith("!")}
    assert not any(place in ("docker", "docker/secrets", ".git", "tests") for place in allowed)


def test_what_images_install_is_pinned():
    pins = {
        re.split(r"==", line)[0].lower().replace("_", "-")
        for line in (DOCKER.parent / "constraints.txt").read_text().splitlines()
        if "==" in line
    }
    wanted = requirements(DOCKER.parent / "pyproject.toml", [".", "tracking"])
    names = {re.split(r"[\[<>=~!]", each)[0].lower().replace("_", "-") for each in wanted}
    assert names <= pins


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_entry_points_are_whole():
    scripts = [
        place
        for place in (DOCKER / "entrypoints").iterdir()
        if place.read_text().startswith("#!/bin/bash\n")
    ]
    assert len(scripts) == 4
    for script in scripts:
        assert script.stat().st_mode & 0o111
        done = subprocess.run(["bash", "-n", str(script)], capture_output=True, check=False)
        assert done.returncode == 0, done.stderr
