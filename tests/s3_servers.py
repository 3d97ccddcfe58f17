"""S3 servers for tests: moto's, Debian's radosgw, one that drops a header, one that never answers.

Each is started by a ``with`` statement, lives in a temporary folder, and is gone after the block.
"""

import shutil
import socket
import subprocess
import sys
import time
import urllib.request
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import pytest
from web import free_port, served

BUCKET = "lmtr-tests"
KEY, SECRET = "TESTKEY", "testsecret"

RADOSGW_TOOLS = ("radosgw", "radosgw-admin", "ceph", "ceph-mon", "ceph-osd", "ceph-authtool")
RADOSGW_PACKAGES = "radosgw ceph-mon ceph-osd ceph-common"

MOTO = """
import threading
from moto.server import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import make_server
moto, turn = DomainDispatcherApplication(create_backend_app), threading.Lock()
def one_by_one(environ, start_response):
    # moto looks whether an object is there and writes it in two steps; a real store does in one.
    with turn:
        return moto(environ, start_response)
server = make_server("127.0.0.1", 0, one_by_one, threaded=True)
print(server.port, flush=True)
server.serve_forever()
"""


@dataclass(frozen=True)
class S3Server:
    """A server with a bucket.

    Attributes:
        endpoint: Its URL.
    """

    endpoint: str

    @property
    def environment(self) -> dict[str, str]:
        """Variables by which it is reached."""
        return {
            "AWS_ENDPOINT_URL": self.endpoint,
            "AWS_ACCESS_KEY_ID": KEY,
            "AWS_SECRET_ACCESS_KEY": SECRET,
            "AWS_REGION": "us-east-1",
        }

    def client(self):
        """Another client than the one under test."""
        import boto3

        return boto3.client(
            "s3",
            endpoint_url=self.endpoint,
            aws_access_key_id=KEY,
            aws_secret_access_key=SECRET,
            region_name="us-east-1",
        )

    def objects(self, prefix: str) -> dict[str, bytes]:
        """All objects below a prefix, by their keys."""
        client = self.client()
        pages = client.get_paginator("list_objects_v2").paginate(Bucket=BUCKET, Prefix=prefix)
        keys = [entry["Key"] for page in pages for entry in page.get("Contents", ())]
        return {key: client.get_object(Bucket=BUCKET, Key=key)["Body"].read() for key in keys}


@contextmanager
def moto_server() -> Iterator[S3Server]:
    """Moto's server, with the bucket made."""
    with _running([sys.executable, "-c", MOTO], stdout=subprocess.PIPE, text=True) as process:
        server = S3Server(f"http://127.0.0.1:{int(process.stdout.readline())}")
        server.client().create_bucket(Bucket=BUCKET)
        yield server


@contextmanager
def radosgw_server(folder: Path, address: str = "127.0.0.1") -> Iterator[S3Server]:
    """Debian's radosgw before one monitor and one store of objects in memory, the bucket made.

    Args:
        folder: Empty, for its files.
        address: Of this machine, that it is reached at.
    """
    missing = [tool for tool in RADOSGW_TOOLS if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} missing: apt-get install {RADOSGW_PACKAGES}")
    monitor, gateway, osd = free_port(), free_port(), str(uuid.uuid4())
    config = _ceph_configuration(folder, monitor)
    ceph_config = ["-c", config]
    with ExitStack() as stack:
        start = lambda *words: stack.enter_context(_running([*words, *ceph_config, "-f"], folder))  # noqa: E731
        call = lambda *words: _done([words[0], *ceph_config, *words[1:]], folder)  # noqa: E731
        call("ceph-mon", "--mkfs", "-i", "a", "--monmap", folder / "monmap")
        start("ceph-mon", "-i", "a")
        call("ceph", "osd", "new", osd)
        call("ceph-osd", "-i", "0", "--osd-uuid", osd, "--mkfs")
        start("ceph-osd", "-i", "0")
        call(
            *("radosgw-admin", "user", "create", "--uid=tests", "--display-name=tests"),
            *("--access-key", KEY, "--secret-key", SECRET),
        )
        place = f"{address}:{gateway}"
        start("radosgw", "-n", "client.admin", f"--rgw-frontends=beast endpoint={place}")
        server = S3Server(f"http://{place}")
        _wait_for(server)
        server.client().create_bucket(Bucket=BUCKET)
        yield server


def _ceph_configuration(folder: Path, port: int) -> Path:
    """Make the configuration, keys and map of a cluster of one; returns the configuration."""
    for name in ("mon", "osd", "run"):
        (folder / name).mkdir()
    identity, keys = str(uuid.uuid4()), folder / "keyring"
    config = folder / "ceph.conf"
    config.write_text(f"""[global]
fsid = {identity}
mon host = v2:127.0.0.1:{port}
public addr = 127.0.0.1
cluster addr = 127.0.0.1
ms bind msgr1 = false
keyring = {keys}
run dir = {folder}/run
admin socket = {folder}/run/$name.$pid.asok
log file = {folder}/$name.log
mon data = {folder}/mon
osd data = {folder}/osd
mon data avail crit = 1
auth cluster required = cephx
auth service required = cephx
auth client required = cephx
osd pool default size = 1
osd pool default min size = 1
mon allow pool size one = true
osd pool default pg num = 1
osd crush chooseleaf type = 0
osd objectstore = memstore
memstore device bytes = 1073741824
""")
    everything = ["--cap", "mon", "allow *", "--cap", "osd", "allow *"]
    for new, name, caps in (
        (["--create-keyring"], "mon.", ["--cap", "mon", "allow *"]),
        ([], "client.admin", everything),
        ([], "osd.0", ["--cap", "mon", "allow profile osd", "--cap", "osd", "allow *"]),
    ):
        _done(["ceph-authtool", *new, keys, "--gen-key", "-n", name, *caps], folder)
    place = f"[v2:127.0.0.1:{port}]"
    _done(
        ["monmaptool", "--create", "--fsid", identity, "--addv", "a", place, folder / "monmap"],
        folder,
    )
    return config


@contextmanager
def dropping_conditions(server: S3Server) -> Iterator[S3Server]:
    """The same store behind a proxy that loses ``If-None-Match``, as old stores and gateways do."""

    class Proxy(BaseHTTPRequestHandler):
        def answer(self) -> None:
            kept = {k: v for k, v in self.headers.items() if k.lower() != "if-none-match"}
            _reply(self, *_passed_on(self, server, kept))

        do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = answer

    with served(Proxy) as endpoint:
        yield S3Server(endpoint)


@contextmanager
def losing_an_answer(server: S3Server, name: str) -> Iterator[S3Server]:
    """The same store behind a gateway that loses one answer: to the first write of an object."""
    lost = []

    class Gateway(BaseHTTPRequestHandler):
        def answer(self) -> None:
            answer = _passed_on(self, server, dict(self.headers))
            if self.command == "PUT" and self.path.partition("?")[0].endswith(name) and not lost:
                lost.append(answer)
                answer = (502, b"", {})
            _reply(self, *answer)

        do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = answer

    with served(Gateway) as endpoint:
        yield S3Server(endpoint)
    assert lost, f"{name} was never written"


@contextmanager
def always_answering(status: int, code: str) -> Iterator[S3Server]:
    """A server that has one answer: an error of S3."""

    class Refusal(BaseHTTPRequestHandler):
        def answer(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            _reply(self, status, f"<Error><Code>{code}</Code></Error>".encode(), {})

        do_GET = do_PUT = do_POST = answer

    with served(Refusal) as endpoint:
        yield S3Server(endpoint)


@contextmanager
def never_answering() -> Iterator[S3Server]:
    """A server that takes connections and says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        yield S3Server(f"http://127.0.0.1:{listening.getsockname()[1]}")


DIRECT = urllib.request.build_opener(urllib.request.ProxyHandler({}))
"""What opens URLs without the proxy that the environment may name."""


def _passed_on(
    handler: BaseHTTPRequestHandler, server: S3Server, headers: dict[str, str]
) -> tuple[int, bytes, dict[str, str]]:
    """What the server answers to a request with these headers: status, content, headers."""
    body = handler.rfile.read(int(handler.headers.get("Content-Length", 0)))
    # Without a type urllib calls every body a form, and moto then takes it for parameters.
    typed = {"Content-Type": "application/octet-stream"} | headers
    request = urllib.request.Request(
        server.endpoint + handler.path, body or None, typed, method=handler.command
    )
    try:
        reply = DIRECT.open(request)
    except urllib.error.HTTPError as error:
        reply = error
    return reply.status, reply.read(), dict(reply.headers)


def _reply(
    handler: BaseHTTPRequestHandler, status: int, content: bytes, headers: dict[str, str]
) -> None:
    handler.send_response(status)
    for name, value in headers.items():
        if name.lower() not in ("connection", "content-length", "date", "server"):
            handler.send_header(name, value)
    # The answer to HEAD names the length of what it leaves out.
    length = headers.get("Content-Length") if handler.command == "HEAD" else None
    handler.send_header("Content-Length", length or str(len(content)))
    handler.end_headers()
    handler.wfile.write(content)


@contextmanager
def _running(command, folder: Path | None = None, **options) -> Iterator[subprocess.Popen]:
    """A process that ends with the block."""
    options.setdefault("stdout", subprocess.DEVNULL)
    process = subprocess.Popen(
        list(map(str, command)), stderr=subprocess.DEVNULL, cwd=folder, **options
    )
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _done(command, folder: Path) -> None:
    made = subprocess.run(
        list(map(str, command)), cwd=folder, capture_output=True, text=True, timeout=90
    )
    if made.returncode:
        raise RuntimeError(f"{command[0]} failed: {made.stderr or made.stdout}")


def _wait_for(server: S3Server, seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while True:
        try:
            with DIRECT.open(server.endpoint, timeout=2):
                return
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.1)
