"""MLflow's web page on the runs of a home."""

import os
import signal
import socket
import subprocess
from types import FrameType

from pipelines.progress import say
from pipelines.workspace import Workspace
from services.errors import TrackingError
from services.tracking import is_server, ui_command, ui_environment
from services.tracking.server import shown


def serve(workspace: Workspace, port: int) -> None:
    """Serve the page on this machine until Ctrl-C or SIGTERM; a tracking server has its own page.

    Raises:
        TrackingError: The port is taken, or the server ended by itself.
    """
    if is_server(workspace.tracker.uri):
        uri = shown(workspace.tracker.uri)
        say(f"MLflow of the home {workspace.home.name}: {uri} is the page of its runs")
        return
    _require_free(port)
    tracker = workspace.tracker
    experiment = tracker.experiment("evaluation")
    # Without the last part MLflow opens on its pages for language models.
    page = f"http://127.0.0.1:{port}/#/experiments/{experiment}/runs"
    said = f"{page}?workflowType=machine_learning"
    say(f"MLflow of the home {workspace.home.name}: {said} (Ctrl-C stops it)")
    environment = {**os.environ, **ui_environment()}
    server = subprocess.Popen(
        ui_command(workspace.home, port), env=environment, start_new_session=True
    )
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        status = server.wait()
    except KeyboardInterrupt:
        # The server has children of its own, and all of them hold the port.
        os.killpg(server.pid, signal.SIGTERM)
        server.wait(timeout=20)
        return
    raise TrackingError(
        f"ui: MLflow's server ended by itself with status {status}; its words above say why"
    )


def _require_free(port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            raise TrackingError(
                f"ui: port {port} cannot be used ({error.strerror}); name another --port"
            ) from error


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt
