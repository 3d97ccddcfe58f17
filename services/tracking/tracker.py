"""Experiments and runs, by explicit ids: nothing hangs on which run is active in the process."""

import fcntl
import hashlib
import logging
import os
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from services.tracking.moved import SQLITE, follow_moved_artifacts
from services.tracking.page import QUIET
from services.tracking.registry import Registry
from services.tracking.run import Run, flat, reported

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import Run as MlflowRun


IDENTITY = "identity"
"""Tag by which a run is found to go on with."""

HOME = "home"
"""Tag with the home that a run is of, where several share a tracker."""

NOISY_LOGGERS = (
    "alembic",
    "mlflow.models.model",
    "mlflow.pyfunc",
    "mlflow.store.db.utils",
    "mlflow.store.model_registry.abstract_store",
    "mlflow.utils.environment",
    "mlflow.utils.validation",
)

KIND = {"mlflow.experimentKind": "custom_model_development"}
"""Without it MLflow's page may show experiments as those of language models."""


def is_server(uri: str) -> bool:
    """Whether a tracker is a server, which has a page and keeps the files of runs by itself."""
    return uri.startswith(("http://", "https://"))


class Tracker:
    """The experiment tracker behind one URI.

    Args:
        uri: MLflow's tracking URI, such as ``sqlite:////home/mlflow.db`` or that of a server.
        artifacts: Folder for the files of runs; made when it is needed, and not with a server.
        home: Which home's runs these are, where several share the tracker: its place; empty where
            it has one of its own.
    """

    def __init__(self, uri: str, artifacts: Path, home: str = "") -> None:
        self.uri = uri
        self.artifacts = artifacts
        self._home = home

    def experiment(self, name: str) -> str:
        """Id of the experiment ``name``, which is made, or taken out of the bin, if need be.

        Any number of processes may ask at once and get the same id.
        """
        with reported(f"experiment {name!r}"):
            return self._found(name) or self._made(name)

    @contextmanager
    def run(
        self,
        experiment_id: str,
        name: str,
        params: Mapping[str, object],
        tags: Mapping[str, str],
        identity: str | None = None,
        parent: str | None = None,
        began: float | None = None,
    ) -> Iterator[Run]:
        """A run that ends with the ``with`` block: finished, failed or killed.

        Args:
            experiment_id: From :meth:`experiment`.
            name: What people call it.
            params: What was chosen; nested mappings become dotted keys. What a run that goes on
                has recorded already stays.
            tags: What it is found by; set anew in a run that goes on.
            identity: What tells it from other runs, kept as tag ``identity``: if there is a run of
                it, that one goes on. None begins a new run.
            parent: Id of the run that it belongs to from now on.
            began: When the work of a new run began (s since 1970); now by default.
        """
        identity = self._own(identity)
        own = {IDENTITY: identity} if identity else {}
        if self._home:
            own[HOME] = self._home
        tags = {**tags, **_links(parent), **own}
        with reported(f"run {name!r}"):
            run, known = self._going_on(experiment_id, identity, tags) or self._begun(
                experiment_id, name, tags, began
            )
        with self._ended(run, name):
            with reported(f"run {name!r}"):
                run.params(flat(params), known)
            yield run

    def end_lost(self, experiment_id: str, tags: Mapping[str, str], silent_s: float = 0.0) -> None:
        """Tell of this home's runs with these tags that they were killed, if they still go on.

        For who knows that no process makes them any more: one that was killed has told nobody. They
        end when they were last heard of.

        Args:
            experiment_id: From :meth:`experiment`.
            tags: What they are found by.
            silent_s: Leave out those heard of within this time (s): processes elsewhere may go on.
        """
        wanted = {**tags, HOME: self._home} if self._home else tags
        with reported("runs that were killed"):
            for run in self._client.search_runs([experiment_id], "attributes.status = 'RUNNING'"):
                if not wanted.items() <= run.data.tags.items():
                    continue
                heard_ms = self._last_heard_ms(run)
                if time.time() - heard_ms / 1000.0 >= silent_s:
                    self._client.set_terminated(run.info.run_id, "KILLED", heard_ms)

    def _last_heard_ms(self, run: "MlflowRun") -> int:
        """When a run began, or got its last figure (ms since 1970)."""
        keys = list(run.data.metrics)[:1]
        told = [m for key in keys for m in self._client.get_metric_history(run.info.run_id, key)]
        heard: int = max([run.info.start_time, *(metric.timestamp for metric in told)])
        return heard

    def _own(self, identity: str | None) -> str | None:
        """An identity that no run of another home has: two may train the same settings."""
        if identity is None or not self._home:
            return identity
        return f"{identity}@{hashlib.sha256(self._home.encode()).hexdigest()[:8]}"

    def _going_on(
        self, experiment_id: str, identity: str | None, tags: Mapping[str, str]
    ) -> tuple[Run, set[str]] | None:
        """The run of an identity under way again, and the parameters it has; None without one."""
        if identity is None:
            return None
        wanted = f"tags.{IDENTITY} = '{identity}'"
        found = self._client.search_runs([experiment_id], wanted, max_results=1)
        if not found:
            return None
        run = Run(self._client, found[0].info.run_id)
        self._client.update_run(run.id, status="RUNNING")
        for key, value in tags.items():
            run.tag(key, value)
        return run, set(found[0].data.params)

    def _begun(
        self, experiment_id: str, name: str, tags: Mapping[str, str], began: float | None
    ) -> tuple[Run, set[str]]:
        start = None if began is None else int(began * 1000)
        made = self._client.create_run(
            experiment_id, start_time=start, tags=dict(tags), run_name=name
        )
        return Run(self._client, made.info.run_id), set()

    @property
    def registry(self) -> Registry:
        """The models that can be loaded by name."""
        return Registry(self._client)

    @contextmanager
    def _ended(self, run: Run, name: str) -> Iterator[None]:
        """End a run with the block, as the block ends."""
        try:
            yield
        except BaseException as error:
            interrupted = isinstance(error, KeyboardInterrupt | GeneratorExit)
            self._end(run, name, "KILLED" if interrupted else "FAILED")
            raise
        self._end(run, name, "FINISHED")

    def _end(self, run: Run, name: str, status: str) -> None:
        with reported(f"run {name!r}"):
            self._client.set_terminated(run.id, status=status)

    def _found(self, name: str) -> str | None:
        experiment = self._client.get_experiment_by_name(name)
        if experiment is None:
            return None
        if experiment.lifecycle_stage == "deleted":
            self._client.restore_experiment(experiment.experiment_id)
        return str(experiment.experiment_id)

    def _made(self, name: str) -> str:
        from mlflow.exceptions import MlflowException

        try:
            place = None if is_server(self.uri) else self.artifacts.as_uri()
            made = self._client.create_experiment(name, artifact_location=place, tags=KIND)
            return str(made)
        except MlflowException as error:
            # Another process was quicker.
            found = self._found(name) if error.error_code == "RESOURCE_ALREADY_EXISTS" else None
            if found is None:
                raise
            return found

    @cached_property
    def _client(self) -> "MlflowClient":
        for name, value in QUIET.items():
            os.environ.setdefault(name, value)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from mlflow import MlflowClient
        for logger in NOISY_LOGGERS:
            logging.getLogger(logger).setLevel(logging.CRITICAL)
        with _alone(self.uri):
            client = MlflowClient(tracking_uri=self.uri)
            client.search_experiments(max_results=1)
            follow_moved_artifacts(self.uri, self.artifacts)
        return client


def _links(parent: str | None) -> dict[str, str]:
    return {} if parent is None else {"mlflow.parentRunId": parent}


@contextmanager
def _alone(uri: str) -> Iterator[None]:
    """Be the only process that makes the tables of a SQLite file: MLflow does not expect others."""
    if not uri.startswith(SQLITE):
        yield
        return
    database = Path(uri.removeprefix(SQLITE))
    with database.with_name(f".{database.name}.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
