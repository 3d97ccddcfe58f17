"""Who has not the token of a Ray head, or is on another machine, gets nothing of it done."""

import http.client
import json
import os
import secrets
import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from contextlib import contextmanager, suppress

import psutil
import pytest
from ray_head import RayHead

pytestmark = pytest.mark.slow

MINE, THEIRS = "10.78.0.1", "10.78.0.2"

CALLS = """
import sys, grpc
from ray.core.generated import gcs_service_pb2 as gcs, gcs_service_pb2_grpc as gcs_calls
from ray.core.generated import node_manager_pb2 as node, node_manager_pb2_grpc as node_calls
token = sys.argv[1]
sent = {"timeout": 20.0, "metadata": (("authorization", f"Bearer {token}"),) if token else ()}
for port in sys.argv[2:]:
    channel = grpc.insecure_channel(f"127.0.0.1:{port}")
    for name, call, asked in (
        ("nodes", gcs_calls.NodeInfoGcsServiceStub(channel).GetAllNodeInfo,
         gcs.GetAllNodeInfoRequest()),
        ("keys", gcs_calls.InternalKVGcsServiceStub(channel).InternalKVKeys,
         gcs.InternalKVKeysRequest()),
        ("stats", node_calls.NodeManagerServiceStub(channel).GetNodeStats,
         node.GetNodeStatsRequest()),
    ):
        try:
            call(asked, **sent)
            print(name, "OK")
        except grpc.RpcError as error:
            print(name, error.code().name)
"""
"""Asks the control store and each node's raylet, as another node would."""


def token_of(head) -> str:
    return head.token_file.read_text().strip()


@pytest.fixture(scope="module")
def head(tmp_path_factory):
    if why := RayHead.obstacle():
        pytest.skip(why)
    folder = tmp_path_factory.mktemp("strangers")
    with RayHead(folder, folder / "home") as running:
        running.earlier = token_of(running)
        running.power_off()
        running.start()
        yield running


@pytest.fixture(params=["none", "wrong", "of an earlier start"])
def no_token(request, head):
    """What strangers may have in its place."""
    others = {"none": "", "wrong": secrets.token_hex(32), "of an earlier start": head.earlier}
    return others[request.param]


def ask(url, token="", body=None, method=None):
    """Status and text of an answer."""
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(
        url, data, {**headers, "Content-Type": "application/json"}, method=method
    )
    try:
        with urllib.request.urlopen(request, timeout=60.0) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode(errors="replace")


def listening(head) -> dict[tuple[str, int], str]:
    """Addresses that the head's processes listen at, with their names."""
    head.look()
    found = {}
    for process in head._seen.values():
        with suppress(psutil.Error):
            for each in process.net_connections(kind="tcp"):
                if each.status == psutil.CONN_LISTEN:
                    found[each.laddr.ip, each.laddr.port] = process.name()
    return found


def test_no_job_is_taken_and_none_is_run(head, no_token, tmp_path):
    mark = tmp_path / "was run"
    job = {"entrypoint": f"touch '{mark}'", "submission_id": f"s{secrets.token_hex(4)}"}
    status, told = ask(f"{head.url}/api/jobs/", no_token, job)
    assert status in (401, 403), told
    status, told = ask(f"{head.url}/api/jobs/", token_of(head))
    assert status == 200
    assert job["submission_id"] not in told
    assert not mark.exists()
    assert ask(f"{head.url}/api/jobs/", token_of(head), job)[0] == 200
    until = time.monotonic() + 60.0
    while not mark.exists() and time.monotonic() < until:
        time.sleep(0.2)
    assert mark.exists()


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/api/version"),
        ("GET", "/api/jobs/"),
        ("GET", "/api/v0/nodes?detail=1"),
        ("GET", "/api/v0/logs?node_ip=127.0.0.1"),
        ("GET", "/nodes?view=summary"),
        ("PUT", "/api/packages/gcs/_ray_pkg_0123456789abcdef.zip"),
        ("POST", "/api/jobs/any/stop"),
        ("DELETE", "/api/jobs/any"),
    ],
)
def test_the_dashboard_tells_nothing(head, no_token, method, path):
    status, told = ask(f"{head.url}{path}", no_token, method=method)
    assert status in (401, 403), told
    assert ask(f"{head.url}{path}", token_of(head), method=method)[0] not in (401, 403)


def test_no_log_is_followed(head, no_token):
    # With the token and no such job Ray's dashboard writes the token into its own log.
    assert ask(f"{head.url}/api/jobs/any/logs/tail", no_token)[0] in (401, 403)


def test_control_store_and_nodes_answer_their_own_alone(head, no_token):
    ports = {
        port for (_, port), name in listening(head).items() if name in ("gcs_server", "raylet")
    }
    assert len(ports) >= 2

    def told(token):
        command = [sys.executable, "-c", CALLS, token, *map(str, sorted(ports))]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
        lines = [tuple(line.split()) for line in done.stdout.splitlines()]
        return {line for line in lines if line[1] not in ("UNIMPLEMENTED", "UNAVAILABLE")}

    calls = ("nodes", "keys", "stats")
    assert told(token_of(head)) == {(call, "OK") for call in calls}
    assert told(no_token) == {(call, "UNAUTHENTICATED") for call in calls}


def test_no_other_port_of_a_node_tells_more_than_numbers(head):
    """Ray's pages of numbers for Prometheus are open: how busy a node is, and nothing else."""
    answered = set()
    for address, port in listening(head):
        host = "127.0.0.1" if address in ("0.0.0.0", "::") else address.removeprefix("::ffff:")
        with suppress(OSError, http.client.HTTPException):  # others speak something else
            status, told = ask(f"http://{host}:{port}/api/jobs/")
            assert status in (401, 403) or told.startswith("# HELP"), (address, port, told[:200])
            assert token_of(head) not in told
            status, told = ask(f"http://{host}:{port}/api/jobs/", body={"entrypoint": "id"})
            assert status in (401, 403, 404, 405), (address, port, told[:200])
            answered.add(port)
    assert len(answered) >= 3


def test_no_process_and_no_log_has_the_token(head):
    head.look()
    for process in head._seen.values():
        with suppress(psutil.Error):
            assert token_of(head) not in " ".join(process.cmdline())
    command = ["grep", "--recursive", "--devices=skip", token_of(head)]
    found = subprocess.run([*command, head._temporary], capture_output=True, text=True, check=False)
    assert found.stdout == ""


@contextmanager
def stranger():
    """A machine of its own beside this one, joined to it by a cable: a network namespace."""
    name = f"lmtr-stranger-{os.getpid()}"
    cable = f"lmtr{secrets.token_hex(3)}"
    words = (
        f"link add {cable} type veth peer name eth0 netns {name}",
        f"addr add {MINE}/30 dev {cable}",
        f"link set {cable} up",
        f"-n {name} addr add {THEIRS}/30 dev eth0",
        f"-n {name} link set eth0 up",
        f"-n {name} link set lo up",
    )
    made = subprocess.run(["ip", "netns", "add", name], capture_output=True, check=False)
    if made.returncode:
        pytest.skip(f"no network namespace can be made: {made.stderr.decode().strip()}")
    try:
        for each in words:
            subprocess.run(["ip", *each.split()], check=True)
        yield name
    finally:
        subprocess.run(["ip", "netns", "delete", name], check=True)


def test_the_dashboard_is_not_there_for_another_machine(head):
    if shutil.which("ip") is None:
        pytest.skip("iproute2 is not installed")
    port = int(head.url.rpartition(":")[2])
    attempt = (
        "import socket, sys\n"
        "for host, port in zip(sys.argv[1::2], sys.argv[2::2]):\n"
        "    try:\n"
        "        socket.create_connection((host, int(port)), 5.0).close()\n"
        "        print('reached')\n"
        "    except OSError as error:\n"
        "        print(error.strerror)\n"
    )
    with socket.create_server(("", 0)) as open_to_all:
        threading.Thread(target=open_to_all.accept, daemon=True).start()
        with stranger() as name:
            places = ("127.0.0.1", port, MINE, port, MINE, open_to_all.getsockname()[1])
            command = ["ip", "netns", "exec", name, sys.executable, "-c", attempt]
            done = subprocess.run(
                [*command, *map(str, places)], capture_output=True, text=True, check=True
            )
    assert done.stdout.split("\n")[:3] == ["Connection refused", "Connection refused", "reached"]
