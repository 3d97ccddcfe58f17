"""What one run records: parameters, metrics in batches, figures, files, tags."""

import re
import tempfile
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from services.errors import TrackingError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mlflow import MlflowClient

METRICS_PER_BATCH = 1000
PARAMS_PER_BATCH = 100
"""What one request of MLflow may carry."""

PARAM_LENGTH = 500
"""Longest value that is kept as a parameter; every MLflow store takes that much."""


@contextmanager
def reported(what: str) -> Iterator[None]:
    """Turn what MLflow, its database and the disk raise into a TrackingError; also a decorator."""
    try:
        yield
    except _faults() as error:
        reason = str(error).partition("\n")[0]
        raise TrackingError(
            f"tracking: {what} cannot be recorded: {reason}; check the tracker's database and disk"
        ) from error


def _faults() -> tuple[type[Exception], ...]:
    from mlflow.exceptions import MlflowException
    from sqlalchemy.exc import SQLAlchemyError

    return MlflowException, SQLAlchemyError, OSError


class Run:
    """One run under way; made by :meth:`Tracker.run`.

    Attributes:
        id: MLflow's id of the run.
    """

    def __init__(self, client: "MlflowClient", run_id: str) -> None:
        self._client = client
        self.id = run_id

    @reported("parameters")
    def params(self, values: Mapping[str, object], known: Collection[str] = ()) -> None:
        """Record what was chosen; a value that is too long is cut, and kept whole as a file.

        Those in ``known`` are left as they are: MLflow takes a parameter once.
        """
        from mlflow.entities import Param

        params = []
        for key, value in values.items():
            name, text = _allowed(key), str(value)
            if name in known:
                continue
            if len(text) > PARAM_LENGTH:
                self._client.log_text(self.id, text, f"params/{name.replace('/', '.')}.txt")
                text = f"{text[: PARAM_LENGTH - 1]}…"
            params.append(Param(name, text))
        for start in range(0, len(params), PARAMS_PER_BATCH):
            self._client.log_batch(self.id, params=params[start : start + PARAMS_PER_BATCH])

    @reported("metrics")
    def metrics(self, rows: Iterable[tuple[str, float, int]]) -> None:
        """Record numbers (key, value, step), a thousand to a request."""
        from mlflow.entities import Metric

        now = int(time.time() * 1000)
        metrics = (Metric(_allowed(key), float(value), now, step) for key, value, step in rows)
        while batch := list(islice(metrics, METRICS_PER_BATCH)):
            self._client.log_batch(self.id, metrics=batch)

    @reported("a figure")
    def figure(self, figure: "Figure | Path", name: str) -> None:
        """Keep a figure, or a picture file, as ``name`` (with its suffix)."""
        if not isinstance(figure, Path):
            self._client.log_figure(self.id, figure, name)
            return
        with tempfile.TemporaryDirectory() as folder:
            # MLflow keeps a file under its own name.
            renamed = Path(folder) / Path(name).name
            renamed.symlink_to(figure.resolve())
            place = str(Path(name).parent)
            self._client.log_artifact(self.id, str(renamed), None if place == "." else place)

    @reported("files")
    def artifacts(self, folder: Path, name: str) -> None:
        """Keep all files of ``folder`` below ``name``."""
        if not folder.is_dir():
            raise NotADirectoryError(f"{folder} is no folder")
        self._client.log_artifacts(self.id, str(folder), name)

    @reported("a tag")
    def tag(self, key: str, value: str) -> None:
        """Set a tag."""
        self._client.set_tag(self.id, key, value)


def flat(values: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    """Nested mappings as one, with dotted keys."""
    return dict(_leaves(values, prefix))


def _leaves(values: Mapping[str, object], prefix: str) -> Iterator[tuple[str, object]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _allowed(key: str) -> str:
    """The key with what MLflow refuses in names replaced by underscores."""
    return re.sub(r"[^\w\-. /:]", "_", key, flags=re.ASCII)
