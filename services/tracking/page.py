"""MLflow's web page on the runs of a home."""

import sys

from services.home import Home

DEFAULT_PORT = 5000


def ui_command(home: Home, port: int = DEFAULT_PORT) -> list[str]:
    """Command that serves the page to this machine alone; run it with :func:`ui_environment`."""
    options = {
        "backend-store-uri": home.tracking_uri,
        "default-artifact-root": home.artifacts.as_uri(),
        "host": "127.0.0.1",
        "port": str(port),
        "workers": "1",
    }
    arguments = [part for name, value in options.items() for part in (f"--{name}", value)]
    return [sys.executable, "-m", "mlflow", "server", *arguments]


def ui_environment() -> dict[str, str]:
    """Environment variables for :func:`ui_command`: a quarter of the memory, and no telemetry."""
    return {"MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false", **QUIET}


QUIET = {"MLFLOW_DISABLE_TELEMETRY": "true", "DO_NOT_TRACK": "true"}
"""Environment of everything that imports MLflow."""
