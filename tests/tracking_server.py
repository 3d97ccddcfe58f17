"""An MLflow server for tests, gone after its block."""

import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from web import free_port

PATIENCE_S = 180.0
"""A server that does not answer after so long never will."""


@contextmanager
def mlflow_server(folder: Path, options: Sequence[str] = ()) -> Iterator[str]:
    """A server of this machine alone whose runs are in a folder; gives its address."""
    port = free_port()
    command = [sys.executable, "-m", "mlflow", "server", "--host=127.0.0.1", f"--port={port}"]
    command += [f"--backend-store-uri=sqlite:///{folder}/mlflow.db", "--workers=1", *options]
    environment = {**os.environ, "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
    with (folder / "server.log").open("w") as log:
        server = subprocess.Popen(
            command, env=environment, stdout=log, stderr=log, start_new_session=True, cwd=folder
        )
    try:
        uri, until = f"http://127.0.0.1:{port}", time.monotonic() + PATIENCE_S
        while not _answers(uri):
            assert server.poll() is None, (folder / "server.log").read_text()
            assert time.monotonic() < until, (folder / "server.log").read_text()
            time.sleep(0.2)
        yield uri
    finally:
        with suppress(ProcessLookupError):
            os.killpg(server.pid, signal.SIGTERM)
        server.wait(timeout=30)


def _answers(uri: str) -> bool:
    with suppress(OSError):
        return bool(urllib.request.urlopen(f"{uri}/health", timeout=5.0).status == 200)
    return False
