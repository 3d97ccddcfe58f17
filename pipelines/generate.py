"""Stage 1: solve tasks on workers, judge the solutions, append them to the lake."""

import functools
import logging
import socket
from collections.abc import Callable, Sequence
from typing import Protocol

import pyarrow as pa

from lmtr.errors import TaskError
from lmtr.expert.solve import Expert, Solution
from lmtr.quality.filter import expected_cost, judge
from lmtr.quality.measure import measure
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import Noise, sample_noise, sample_task
from lmtr.task.task import Task
from lmtr.vectors.layout import SEGMENT_LAYOUT, TASK_LAYOUT
from pipelines import records
from pipelines.config import Configuration
from pipelines.datasets import DECIDING, announce, asking, require_same
from pipelines.expert import build_expert, told
from pipelines.generation_log import generation_log
from pipelines.generation_tally import GenerationTally
from pipelines.production import Plan, lacking, produce
from pipelines.progress import say
from pipelines.provenance import code_version
from pipelines.turns import beside_others
from pipelines.workspace import Workspace
from services.cache import machine_cache
from services.cluster.delivery import Note
from services.lake.appender import Appender, Group
from services.lake.digest import sealed
from services.lake.housekeeping import join_files
from services.lake.schemas import SCHEMAS

logger = logging.getLogger(__name__)


class Solver(Protocol):
    """What solves tasks: the expert, or something as good for a test of scale."""

    def solve(self, task: Task, noise: Noise) -> Solution:
        """Optimize from the noisy initial guess."""
        ...


MakeExpert = Callable[[Configuration], Solver]


class SolveWorker:
    """Solves and judges tasks by index; one per process, so the compiled expert is loaded once."""

    def __init__(self, config: Configuration, make_expert: MakeExpert = build_expert) -> None:
        self._config = config
        self._expert = make_expert(config)
        self._dataset_id = config.dataset_id
        self._cost_key = config.expert.cost_key(config.dataset.robot)
        if config.cluster.address and (news := _news(self._expert, config)):
            logger.warning("%s: %s", socket.gethostname(), news)

    def __call__(self, index: int) -> tuple[records.Row, Note]:
        """The row of ``solutions`` for the task of this index, and what is counted of it."""
        config, robot = self._config, self._config.dataset.robot
        task, noise = drawn(config, index)
        solution = self._expert.solve(task, noise)
        violations = measure(solution.trajectory, robot, task.obstacles_W)
        expected = expected_cost(task, robot, self._cost_key, config.quality)
        verdict = judge(
            str(solution.status),
            solution.cost,
            expected,
            violations,
            config.quality,
            solution.saturated,
        )
        row = {
            **identity(self._dataset_id, index),
            **records.task_columns(task, noise),
            **records.solution_columns(solution, verdict, violations, expected),
        }
        return row, records.solution_note(row)

    @staticmethod
    def pack(rows: Sequence[records.Row]) -> pa.Table:
        """Rows as a table, each with its digest."""
        return sealed("solutions", pa.Table.from_pylist(list(rows), schema=SCHEMAS["solutions"]))


def drawn(config: Configuration, index: int) -> tuple[Task, Noise]:
    """Task and noise of this index; they depend on it and the configuration alone."""
    rng = stream(config.dataset.seed, Purpose.TASK, index)
    task = sample_task(config.tasks, config.dataset.robot, rng)
    return task, sample_noise(config.tasks, config.expert.scope.n_swings, rng)


def identity(dataset_id: str, index: int) -> records.Row:
    """Columns that say which row this is and what made it."""
    return {
        "dataset_id": dataset_id,
        "index": index,
        "code_version": code_version(),
        "config_hash": dataset_id.rsplit("-", 1)[-1],
        "created_at": records.now(),
    }


def generate(
    config: Configuration,
    workspace: Workspace,
    make_expert: MakeExpert = build_expert,
    *,
    again: str | None = None,
) -> str:
    """Solve what the data set still lacks; returns its id. Committed rows survive any stop.

    Args:
        config: Which data set, and how it is made.
        workspace: The home.
        make_expert: Makes what solves tasks in each worker; travels by pickle.
        again: Solutions that ended with this status are dropped first, and solved once more.

    Raises:
        ConfigurationError: The data set is there, made with other settings.
        HomeError: Another process makes the same data set, or a repair is at work.
        KeyboardInterrupt: The user stopped it; what was solved is kept.
    """
    dataset_id, lake = config.dataset_id, workspace.lake
    with beside_others(workspace.home, f"generate-{dataset_id}"):
        require_same(config, workspace)
        if again is not None:
            config = _without(config, workspace, again)
        if not lacking(workspace, _group(dataset_id), range(config.dataset.solutions)):
            _register(config, workspace)  # a repair may have taken the description out
            present = _solved(workspace, dataset_id)
            say(f"generate: {dataset_id} has {present} solutions already, nothing to do")
            return dataset_id
        _prepare_expert(config, make_expert)
        announce(config, workspace)
        _register(config, workspace)  # only what can be solved becomes a data set
        tally = GenerationTally(dataset_id)
        try:
            with generation_log(config, workspace, tally) as logged:
                if not produce(workspace, _plan(config, make_expert), logged):
                    raise KeyboardInterrupt
        except KeyboardInterrupt:
            kept = _solved(workspace, dataset_id)
            say(
                f"generate: {dataset_id}: stopped with {kept} of {config.dataset.solutions} "
                f"solutions; go on with `lmtr generate --dataset {dataset_id} --solutions "
                f"{config.dataset.solutions}`, or the same command"
            )
            raise
        join_files(lake, "solutions")
    say(f"generate: {dataset_id}: {tally.result()}; table version {lake.version('solutions')}")
    return dataset_id


def _without(config: Configuration, workspace: Workspace, status: str) -> Configuration:
    """Take solutions that ended with ``status`` out; returns settings that ask for them again."""
    before, _ = Appender(workspace.lake, _group(config.dataset_id)).present()
    where = f"dataset_id = '{config.dataset_id}' AND status = '{status}'"
    count = workspace.lake.delete("solutions", where)
    say(f"generate: {count} solutions that ended with {status!r} are solved once more")
    return asking(config, max(config.dataset.solutions, before.end))


def _solved(workspace: Workspace, dataset_id: str) -> int:
    """How many solutions of a data set are in the lake."""
    present, _ = Appender(workspace.lake, _group(dataset_id)).present()
    return len(present)


def _group(dataset_id: str) -> Group:
    """The rows of a data set."""
    return Group("solutions", {"dataset_id": dataset_id}, "index")


def _plan(config: Configuration, make_expert: MakeExpert) -> Plan[int]:
    return Plan(
        title="Solving tasks",
        group=_group(config.dataset_id),
        keys=range(config.dataset.solutions),
        items=iter,
        make_worker=functools.partial(SolveWorker, config, make_expert),
        failed=functools.partial(_failed, config),
    )


def _failed(config: Configuration, index: int, error: str) -> tuple[pa.Table, Note]:
    """The row of a task whose work failed outside the optimizer; nothing was solved."""
    try:
        posed = records.task_columns(*drawn(config, index))
    except TaskError:  # drawing it is what failed
        posed = {}
    row = {**identity(config.dataset_id, index), **posed, **records.error_columns(error)}
    return SolveWorker.pack([row]), records.solution_note(row)


def _prepare_expert(config: Configuration, make_expert: MakeExpert) -> None:
    """Compile the expert before the workers start, so that they find it in the cache.

    Hosts of a cluster compile for their own processors, and this one may be none that solves: there
    it is only seen whether the expert can be built.
    """
    if config.cluster.address:
        Expert(config.dataset.robot, config.expert, None)
        return
    if news := _news(make_expert(config), config):
        say(f"generate: {news}")


def _news(expert: Solver, config: Configuration) -> str:
    """How the expert came to be, as far as people should know."""
    if not isinstance(expert, Expert):
        return ""
    return told(expert.build_report, machine_cache(config.cluster.cache))


def _register(config: Configuration, workspace: Workspace) -> None:
    """Describe the data set once in ``datasets``."""
    row = {
        "dataset_id": config.dataset_id,
        "seed": config.dataset.seed,
        "configuration": config.model_dump_json(include=set(DECIDING)),
        "robot": config.dataset.robot.name,
        "layouts": records.to_json(
            {"task": TASK_LAYOUT.metadata(), "segment": SEGMENT_LAYOUT.metadata()}
        ),
        "code_version": code_version(),
        "created_at": records.now(),
    }
    workspace.lake.append_rows("datasets", [row], app_id=f"datasets/{config.dataset_id}")
