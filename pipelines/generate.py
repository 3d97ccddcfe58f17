"""Stage 1: solve tasks on workers, judge the solutions, append them to the lake."""

import functools
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

from lmtr.errors import TaskError
from lmtr.quality.filter import expected_cost, judge
from lmtr.quality.measure import measure
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import Noise, sample_noise, sample_task
from lmtr.task.task import Task
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from pipelines import records
from pipelines.config import Configuration
from pipelines.expert import build_expert, told
from pipelines.progress import bar, say
from pipelines.provenance import code_version
from pipelines.workspace import Workspace
from services.cache import machine_cache


class SolveWorker:
    """Solves and judges tasks by index; one per process, so the compiled expert is loaded once."""

    def __init__(self, config: Configuration) -> None:
        self._config = config
        self._expert = build_expert(config)

    def __call__(self, index: int) -> records.Row:
        """The row of ``solutions`` for the task of this index."""
        config, robot = self._config, self._config.dataset.robot
        task, noise = drawn(config, index)
        solution = self._expert.solve(task, noise)
        violations = measure(solution.trajectory, robot, task.obstacles_W)
        expected = expected_cost(task, robot, config.expert.cost_key(robot), config.quality)
        verdict = judge(
            str(solution.status),
            solution.cost,
            expected,
            violations,
            config.quality,
            solution.saturated,
        )
        return {
            **identity(config, index),
            **records.task_columns(task, noise),
            **records.solution_columns(solution, verdict, violations, expected),
        }


def drawn(config: Configuration, index: int) -> tuple[Task, Noise]:
    """Task and noise of this index; they depend on it and the configuration alone."""
    rng = stream(config.dataset.seed, Purpose.TASK, index)
    task = sample_task(config.tasks, config.dataset.robot, rng)
    return task, sample_noise(config.tasks, config.expert.scope.n_swings, rng)


def identity(config: Configuration, index: int) -> records.Row:
    """Columns that say which row this is and what made it."""
    return {
        "dataset_id": config.dataset_id,
        "index": index,
        "code_version": code_version(),
        "config_hash": config.dataset_id.rsplit("-", 1)[-1],
        "created_at": records.now(),
    }


def generate(config: Configuration, workspace: Workspace) -> str:
    """Solve what the data set still lacks; returns its id. Committed rows survive any stop."""
    dataset_id, lake = config.dataset_id, workspace.lake
    with workspace.home.lock(f"generate-{dataset_id}"):
        present = _present(workspace, dataset_id)
        missing = [i for i in range(config.dataset.solutions) if i not in present]
        if not missing:
            say(f"generate: {dataset_id} has {len(present)} solutions already, nothing to do")
            return dataset_id
        _prepare_expert(config)
        _register(config, workspace)  # only what can be solved becomes a data set
        writer = _Writer(workspace, dataset_id)
        with bar("Solving tasks", len(missing)) as progress:
            try:
                for row in _solve(config, workspace, missing):
                    writer.add(row)
                    progress.advance(note=writer.summary())
            finally:
                # A stop of any kind keeps what is solved.
                writer.flush()
        lake.compact("solutions")
        say(
            f"generate: {dataset_id}: {writer.summary()}; table version {lake.version('solutions')}"
        )
    return dataset_id


def _solve(
    config: Configuration, workspace: Workspace, missing: list[int]
) -> Iterator[records.Row]:
    make_worker = functools.partial(SolveWorker, config)
    with workspace.cluster(len(missing)) as cluster:
        for outcome in cluster.stream(make_worker, missing):
            if outcome.error is None:
                yield outcome.value
            else:
                yield _failed(config, outcome.item, outcome.error)


def _failed(config: Configuration, index: int, error: str) -> records.Row:
    """The row of a task whose work failed outside the optimizer; nothing was solved."""
    try:
        posed = records.task_columns(*drawn(config, index))
    except TaskError:  # drawing it is what failed
        posed = {}
    return {**identity(config, index), **posed, **records.error_columns(error)}


def _prepare_expert(config: Configuration) -> None:
    """Compile the expert before the workers start, so that they find it in the cache."""
    news = told(build_expert(config).build_report, machine_cache(config.cluster.cache))
    if news:
        say(f"generate: {news}")


def _register(config: Configuration, workspace: Workspace) -> None:
    """Describe the data set once in ``datasets``."""
    row = {
        "dataset_id": config.dataset_id,
        "seed": config.dataset.seed,
        "configuration": config.model_dump_json(include={"dataset", "tasks", "expert", "quality"}),
        "robot": config.dataset.robot.name,
        "layouts": records.to_json(
            {"task": TASK_LAYOUT.metadata(), "segment": SEGMENT_LAYOUT.metadata()}
        ),
        "code_version": code_version(),
        "created_at": records.now(),
    }
    workspace.lake.append_rows("datasets", [row], app_id=f"datasets/{config.dataset_id}")


def _present(workspace: Workspace, dataset_id: str) -> set[int]:
    return set(workspace.lake.values("solutions", "index", f"dataset_id = '{dataset_id}'"))


class _Writer:
    """Gathers rows and appends them in idempotent transactions, by count or by time."""

    def __init__(self, workspace: Workspace, dataset_id: str) -> None:
        self._lake = workspace.lake
        self._settings = workspace.cluster_settings
        self._app_id = f"solutions/{dataset_id}"
        self._rows: list[dict[str, Any]] = []
        self._committed = time.monotonic()
        self._statuses: Counter[str] = Counter()
        self._accepted = 0

    def add(self, row: records.Row) -> None:
        """Take one row; append the batch when it is large or old enough."""
        self._rows.append(row)
        self._statuses[row["status"]] += 1
        self._accepted += row["accepted"]
        age = time.monotonic() - self._committed
        if len(self._rows) >= self._settings.commit_rows or age > self._settings.commit_seconds:
            self.flush()

    def flush(self) -> None:
        """Append what is gathered."""
        if self._rows:
            number = self._lake.next_number("solutions", self._app_id)
            self._lake.append_rows("solutions", self._rows, app_id=self._app_id, number=number)
            self._rows = []
        self._committed = time.monotonic()

    def summary(self) -> str:
        """Statuses and the accepted share so far, for people."""
        total = sum(self._statuses.values())
        if total == 0:
            return "nothing solved yet"
        kinds = ", ".join(f"{count} {status}" for status, count in self._statuses.most_common())
        return f"{kinds}; {self._accepted / total:.0%} accepted"
