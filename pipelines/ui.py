"""MLflow's web page on the runs of a home."""

import os
import subprocess

from pipelines.progress import say
from pipelines.workspace import Workspace
from services.errors import TrackingError
from services.tracking import ui_command, ui_environment


def serve(workspace: Workspace, port: int) -> None:
    """Serve the page on this machine until Ctrl-C.

    Raises:
        TrackingError: The server could not be started, or ended by itself.
    """
    say(f"MLflow on http://127.0.0.1:{port} (Ctrl-C stops it)")
    environment = {**os.environ, **ui_environment()}
    server = subprocess.Popen(ui_command(workspace.home, port), env=environment)
    try:
        status = server.wait()
    except KeyboardInterrupt:
        server.terminate()
        server.wait(timeout=20)
        return
    if status != 0:
        raise TrackingError(
            f"ui: MLflow's server ended with status {status}; see its words above, or try another "
            f"--port than {port}"
        )
