"""Ray on this machine or on many: how it is started, reached and left."""

import os
import secrets
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Generator, Iterable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from services.cluster.cluster import Cluster, Outcome
from services.cluster.delivery import Event, Order
from services.cluster.sweep import Sweep
from services.errors import ClusterError

T = TypeVar("T")
R = TypeVar("R")

OBJECT_STORE_BYTES = 250_000_000
"""Shared memory of a Ray started here: enough for a data set, small beside a laptop's memory."""

REACH_S = 45.0
"""How long a named cluster may take to answer."""

SUBMITTED = "RAY_JOB_CONFIG_JSON_ENV_VAR"
"""Ray sets it for the command of a submitted job, which therefore has a raylet beside it."""

HEALTH = {
    "RAY_health_check_initial_delay_ms": "3000",
    "RAY_health_check_period_ms": "1000",
    "RAY_health_check_timeout_ms": "2000",
    "RAY_health_check_failure_threshold": "3",
    "RAY_grpc_client_keepalive_time_ms": "5000",
    "RAY_grpc_client_keepalive_timeout_ms": "5000",
}
"""A host that falls silent is noticed after some ten seconds: three checks, a second apart, are not
answered within two. With Ray's defaults (five, three, ten) it takes more than a minute.

Every process of a cluster must have these, so a cluster that is joined sets them on its hosts.
"""

ENVIRONMENT = {
    **HEALTH,
    "RAY_USAGE_STATS_ENABLED": "0",
    # Under `uv run` Ray would rebuild the environment in each worker and hang.
    "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0",
}


class RayCluster(Cluster):
    """Worker processes that Ray places.

    A Ray that already runs in this process is shared and left running.
    """

    def __init__(self, address: str | None, workers: int | None, log_level: int) -> None:
        self._address = address
        self._workers = workers
        self._log_level = log_level
        self._size = 0
        self._leave = ExitStack()

    def __enter__(self) -> Self:
        _prepare(self._address)
        import ray

        with ExitStack() as undo:
            if not ray.is_initialized():
                undo.callback(ray.shutdown)
                if self._address is None:
                    self._start(undo)
                else:
                    self._join(self._address)
            cores = max(1, int(ray.cluster_resources().get("CPU", 1)))
            self._size = min(self._workers or cores, cores)
            self._leave = undo.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._leave.close()

    def stream(
        self,
        make_worker: Callable[[], Callable[[T], R]],
        items: Iterable[T],
        *,
        in_flight: int | None = None,
    ) -> Generator[Outcome[T, R], None, None]:
        """See :meth:`Cluster.stream`."""
        from services.cluster.pool import ActorPool

        if not self._size:
            raise ClusterError("cluster: it is closed; use it inside its `with` statement")
        size = self._size if in_flight is None else max(1, min(in_flight, self._size))
        pool: ActorPool[T, R] = ActorPool(make_worker, size)
        yield from pool.outcomes(items)

    def deliver(self, order: Order[T]) -> Generator[Event, None, None]:
        """See :meth:`Cluster.deliver`."""
        from services.cluster.ray_line import RayLine

        if not self._size:
            raise ClusterError("cluster: it is closed; use it inside its `with` statement")
        yield from RayLine(order, self._size, _ray_runs).events()

    def sweep(self, sweep: Sweep[Any, Any, Any]) -> None:
        """See :meth:`Cluster.sweep`."""
        from services.cluster.ray_sweep import run_sweep

        if not self._size:
            raise ClusterError("cluster: it is closed; use it inside its `with` statement")
        run_sweep(sweep, self._size)

    def _start(self, undo: ExitStack) -> None:
        import ray

        # Ray's sockets lie in here, and the path of a socket may have 107 characters at most.
        folder = tempfile.mkdtemp(prefix="lmtr-", dir="/tmp" if Path("/tmp").is_dir() else None)
        undo.callback(shutil.rmtree, folder, ignore_errors=True)
        # The last callback runs first: Ray must end before its folder is removed.
        undo.callback(ray.shutdown)
        try:
            ray.init(
                address="local",
                num_cpus=self._workers,
                include_dashboard=False,
                object_store_memory=OBJECT_STORE_BYTES,
                logging_level=self._log_level,
                log_to_driver=False,
                # Ray opens its own folder to all users of the machine, who could put their sockets
                # in the place of its own; the one around it stays closed.
                _temp_dir=str(Path(folder, "r")),
            )
        except (RuntimeError, ValueError, OSError, TimeoutError) as error:
            raise ClusterError(
                f"cluster: Ray does not start on this machine: {' '.join(str(error).split())}; "
                "work in this process with --workers 0"
            ) from error

    def _join(self, address: str) -> None:
        import ray

        if SUBMITTED not in os.environ:
            _require_reachable(address)
        try:
            ray.init(address=address, logging_level=self._log_level, log_to_driver=False)
        except (RuntimeError, ValueError, OSError) as error:
            raise _unreachable(address, str(error)) from error


def _ray_runs() -> bool:
    """Whether the Ray that this process started still runs; one of others is not looked at.

    Some time after its raylet or its control store has ended, Ray ends the driver too, without a
    word. Ray has no public way to ask for them, so where its inner ones change this says yes.
    """
    from ray._private import worker

    node = getattr(worker, "_global_node", None)
    started = getattr(node, "all_processes", {})
    needed = [entry for name in ("raylet", "gcs_server") for entry in started.get(name, [])]
    return all(entry.process.poll() is None for entry in needed)


def _prepare(address: str | None) -> None:
    """Say in the environment, where alone Ray reads it, what must not be left to its defaults.

    What the user has set there stays. A Ray started here is closed to other users of the machine
    by a token that only its own processes know; without one in the environment Ray would write a
    token file into the user's home, which changes what other clusters do.
    """
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    if "RAY_AUTH_MODE" in os.environ:
        return
    has_token = "RAY_AUTH_TOKEN" in os.environ or "RAY_AUTH_TOKEN_PATH" in os.environ
    if address is None and not has_token:
        os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(32)
    # Ray reads the mode when it is imported. One that is imported already closes a local cluster
    # by itself, and would take a mode set now for one that is in force.
    if "ray" not in sys.modules:
        os.environ["RAY_AUTH_MODE"] = "token" if has_token or address is None else "disabled"


def _require_reachable(address: str) -> None:
    """Join the cluster for a moment in a process of its own.

    Ray waits for minutes for a host that does not answer, and cannot be interrupted.
    """
    trial = (
        "import ray, sys\n"
        "ray.init(address=sys.argv[1], logging_level='ERROR', log_to_driver=False)\n"
        "ray.shutdown()\n"
    )
    try:
        done = subprocess.run(
            [sys.executable, "-c", trial, address],
            capture_output=True,
            text=True,
            timeout=REACH_S,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise _unreachable(address, f"no answer within {REACH_S:.0f} s") from error
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        raise _unreachable(address, lines[-1] if lines else f"exit status {done.returncode}")


def _unreachable(address: str, reason: str) -> ClusterError:
    return ClusterError(
        f"cluster: no Ray cluster can be joined at {address!r}: {' '.join(reason.split())}; check "
        "the address, RAY_AUTH_MODE and RAY_AUTH_TOKEN, and run on one of the cluster's hosts"
    )
