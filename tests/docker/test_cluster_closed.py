"""A cluster of containers as strangers, and the curious, find it; and what it weighs."""

import socket
import subprocess
import urllib.error

import pytest

from lmtr import __version__
from pipelines.provenance import code_version

pytestmark = [pytest.mark.slow, pytest.mark.cluster]

PUBLISHED = {"head": "8265/tcp", "tracking": "5000/tcp"}


def test_ports_are_open_to_this_machine_alone(containers):
    for name in containers.names():
        told = containers.inspect(name)
        published = {port: at for port, at in told["NetworkSettings"]["Ports"].items() if at}
        service = told["Config"]["Labels"]["com.docker.compose.service"]
        wanted = {PUBLISHED[service]} if service in PUBLISHED else set()
        assert set(published) == wanted
        assert {at["HostIp"] for ats in published.values() for at in ats} <= {"127.0.0.1"}


def test_another_network_namespace_reaches_nothing(containers):
    hosts = [containers.inspect(name)["NetworkSettings"] for name in containers.names()]
    places = [
        (network["IPAddress"], port)
        for host in hosts
        for network in host["Networks"].values()
        for port in (5000, 5432, 6379, 8265)
    ]
    places += [("172.17.0.1", port) for port in containers.ports]
    attempt = "timeout 2 bash -c 'exec 3<> /dev/tcp/{}/{}' 2> /dev/null && echo reached {} {} & "
    with socket.create_server(("172.17.0.1", 0)) as open_to_all:
        reachable = open_to_all.getsockname()
        places.append(reachable)
        script = "".join(attempt.format(*place, *place) for place in places)
        command = ("run", "--rm", "--network", "bridge", containers.image("node"))
        reached = containers.docker(*command, "bash", "-c", f"{script} wait").splitlines()
    assert reached == ["reached {} {}".format(*reachable)]


@pytest.mark.parametrize("token", [None, "0" * 64])
def test_jobs_are_refused_without_the_token(containers, token):
    with pytest.raises(urllib.error.HTTPError) as refused:
        containers.ask("/api/jobs/", {"entrypoint": "id"}, token=token)
    assert refused.value.code in (401, 403)


def test_a_token_that_has_become_known_is_changed_by_removing_it(containers):
    known = containers.token
    containers.remake("ray_token")
    assert containers.token != known
    containers.await_healthy()
    with pytest.raises(urllib.error.HTTPError) as refused:
        containers.ask("/api/jobs/", token=known)
    assert refused.value.code in (401, 403)
    assert containers.lmtr("status").returncode == 0


def test_the_tracking_server_refuses_other_names(containers):
    command = ["curl", "--silent", "--output", "/dev/null", "--write-out", "%{http_code}"]
    url = f"http://127.0.0.1:{containers.ports[1]}/api/2.0/mlflow/experiments/search?max_results=1"
    for host, status in (("localhost", "200"), ("stranger.example", "403")):
        done = subprocess.run(
            [*command, "--header", f"Host: {host}", url], capture_output=True, text=True, check=True
        )
        assert done.stdout == status, host


def test_secrets_are_told_nowhere(containers):
    told = [containers.docker("inspect", name) for name in containers.names()]
    told += [containers.docker("top", name, "-eo", "pid,args") for name in containers.names()]
    told += [
        containers.docker("history", "--no-trunc", containers.image(role))
        for role in ("node", "tracking", "database")
    ]
    told += [containers.logs(name) for name in containers.names()]
    for secret in (containers.token, containers.password):
        assert not any(secret in text for text in told)


def test_no_file_of_a_node_holds_the_token_but_the_log_that_is_known_for_it(containers):
    look = "find /tmp /data /cache -type f -exec grep -lFf /run/secrets/ray_token {} + || true"
    for service in ("head", "worker"):
        found = containers.inside(service, "sh", "-c", look).splitlines()
        assert all(place.endswith("/logs/dashboard.log") for place in found), found


def test_containers_are_not_root_and_cannot_change_themselves(containers):
    for service in ("head", "worker", "tracking", "database"):
        assert containers.inside(service, "id", "-u").strip() != "0"
        attempt = "touch /usr/bin/other 2>/dev/null && echo changed || echo refused"
        assert containers.inside(service, "sh", "-c", attempt).strip() == "refused"
        status = containers.inside(service, "sh", "-c", "grep CapEff /proc/1/status")
        assert int(status.split()[1], 16) == 0


def test_images_say_what_they_are_made_of(containers):
    for role in ("node", "tracking"):
        (image,) = containers.images(role)
        labels = image["Config"]["Labels"]
        assert labels["org.opencontainers.image.version"] == __version__
        assert f"{__version__}+{labels['org.opencontainers.image.revision']}" == code_version()
    asked = "from pipelines.provenance import code_version; print(code_version())"
    assert containers.inside("head", "python", "-c", asked).strip() == code_version()


def test_the_expert_is_compiled_where_it_runs(containers, reference):
    (image,) = containers.images("node")
    command = ("run", "--rm", "--entrypoint", "find", image["Id"], "/cache", "-name", "*.so")
    assert containers.docker(*command) == ""
    kept = containers.inside("worker", "find", "/cache/lmtr", "-name", "*.so")
    assert kept.strip().endswith(".so")


def test_what_the_idle_cluster_weighs(containers):
    used = containers.memory_mb()
    sizes = {role: containers.images(role)[0]["Size"] / 1e6 for role in ("node", "tracking")}
    print(f"up in {containers.up_s:.0f} s; idle {sum(used.values()):.0f} MiB: {used}; MB: {sizes}")
    assert len(used) == 5
    assert containers.up_s < 60.0
    assert sum(used.values()) < 2.5 * 1024.0
