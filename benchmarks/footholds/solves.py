"""Solves as rows: where the feet came down beside the lines, and how far the legs reached."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
from rich.progress import track

from benchmarks.footholds.families import Group
from benchmarks.kept import Row, read_rows, write_rows
from benchmarks.solving.circumstances import Circumstances, made_by
from benchmarks.solving.evidence import Evidence
from benchmarks.solving.evidence import solve as solve_task
from lmtr.arrays import Array
from lmtr.expert.settings import ExpertSettings
from lmtr.expert.solve import Expert
from lmtr.geometry.line import signed_distance
from lmtr.quality.filter import QualityThresholds
from lmtr.robot.model import RobotModel
from lmtr.rollout.metrics import forward_offset, forward_violation
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import sample_noise, sample_task
from lmtr.trajectory.motion import sampled

SEED = 2718
"""Seed of all tasks; those of other benchmarks are others."""

LIMIT = 0.2
"""Forward range of motion (m) that replanners are judged by (Sec. 5.2)."""

SAMPLE_STEP = 0.005
"""Spacing of the samples at which reaches are measured (s)."""


@dataclass(frozen=True)
class Walk:
    """One solve in figures.

    Attributes:
        group: Name of its group.
        index: Number of its task.
        iterations: Iterations of the solver.
        cpu_s: Processor time of the solve (s).
        reasons: Why the quality filter refuses it, empty if it is accepted; see :func:`judged`.
        evidence: Its task, its cost and what else the filter judges.
        apart: Signed distance of every foothold but the given first ones to every line
            (n, 4, N̄_p) in m, positive beyond the line.
        reach: Furthest that a standing foot is ahead of neutral or behind it (m).
        violation: Mean over standing feet and samples of what of this exceeds ``LIMIT`` (m).
        overshoot: Furthest that a standing foot leaves its own range of motion (m).
        compiled: Whether the expert ran as machine code.
    """

    group: str
    index: int
    iterations: int
    cpu_s: float
    reasons: tuple[str, ...]
    evidence: Evidence
    apart: Array
    reach: float
    violation: float
    overshoot: float
    compiled: bool

    @property
    def converged(self) -> bool:
        """Whether the solver converged."""
        return self.evidence.converged

    @property
    def cost(self) -> float:
        """Its cost."""
        return self.evidence.cost

    @property
    def distance(self) -> float:
        """From start to goal (m)."""
        task = self.evidence.task
        return float(np.linalg.norm(task.goal_pose_W[:2] - task.start_pose_W[:2]))

    @property
    def accepted(self) -> bool:
        """Whether the quality filter accepts it."""
        return not self.reasons

    @property
    def closest(self) -> Array:
        """Distance of each line to each foot's closest foothold, (n, 4) in m."""
        return np.asarray(np.abs(self.apart).min(axis=-1))


def solve(expert: Expert, group: Group, index: int) -> Walk:
    """Solve one task of a group."""
    rng = stream(SEED, Purpose.TASK, index)
    task = sample_task(group.tasks, group.robot, rng)
    noise = sample_noise(group.tasks, group.settings.scope.n_swings, rng)
    solution, evidence = solve_task(expert, task, noise)
    motion = sampled(solution.trajectory, SAMPLE_STEP)
    # Lines are directed to the left of the path, so the side beyond them has negative distance.
    apart = -signed_distance(task.obstacles_W[:, None, None], solution.trajectory.footholds[:, 1:])
    return Walk(
        group=group.name,
        index=index,
        iterations=solution.iterations,
        cpu_s=solution.solve_cpu_s,
        reasons=(),
        evidence=evidence,
        apart=apart,
        reach=float(np.nanmax(np.abs(forward_offset(motion, group.robot)))),
        violation=float(np.nanmean(forward_violation(motion, group.robot, LIMIT))),
        overshoot=evidence.figures["stance_overshoot"],
        compiled=expert.compiled,
    )


def judged(walks: Iterable[Walk], groups: Iterable[Group]) -> list[Walk]:
    """The same with the filter's present reasons."""
    by_name = {group.name: group for group in groups}
    found = []
    for walk in walks:
        group = by_name[walk.group]
        thresholds = QualityThresholds(judge_cost=group.judge_cost)
        key = group.settings.cost_key(group.robot)
        reasons = walk.evidence.reasons(group.robot, key, thresholds)
        found.append(replace(walk, reasons=reasons))
    return found


def solve_groups(
    groups: Iterable[Group],
    count: int,
    build: Callable[[RobotModel, ExpertSettings], Expert],
    kept: Sequence[Walk],
    save: Callable[[Sequence[Walk]], None],
) -> list[Walk]:
    """Solve the first tasks of all groups, and save after each group.

    Args:
        groups: The groups.
        count: Tasks of each.
        build: Makes an expert.
        kept: Walks that need not be solved again.
        save: Called with all walks so far.
    """
    walks = list(kept)
    expert: Expert | None = None
    for group in groups:
        known = {walk.index for walk in kept if walk.group == group.name}
        missing = [index for index in range(count) if index not in known]
        if not missing:
            continue
        if expert is None or (expert.robot, expert.settings) != (group.robot, group.settings):
            expert = build(group.robot, group.settings)
        walks += [solve(expert, group, index) for index in track(missing, group.name)]
        save(walks)
    return walks


def write(path: Path, made: Circumstances, groups: Iterable[Group], walks: Sequence[Walk]) -> None:
    """Keep walks in a file, under what made them and without the filter's verdict.

    Distances to lines are kept to a tenth of a millimetre.
    """
    rows = []
    for walk in walks:
        row = {f.name: getattr(walk, f.name) for f in fields(walk) if f.name != "reasons"}
        row["evidence"] = walk.evidence.as_row()
        rows.append(row | {"apart": np.round(walk.apart, 4).tolist()})
    keys = {group.name: group.key for group in groups}
    write_rows(path, {"circumstances": asdict(made), "groups": keys}, rows)


def read(path: Path, groups: Iterable[Group]) -> tuple[Circumstances, list[Walk]]:
    """What made the walks that :func:`write` kept, and those of groups that are the same.

    They are not judged yet.

    Raises:
        DataError: There is no such file, or it does not tell.
    """
    head, rows = read_rows(path, "obstacles")
    same = {group.name for group in groups if head.get("groups", {}).get(group.name) == group.key}
    made = made_by(head, "obstacles")
    return made, [_walk(row) for row in rows if row["group"] in same]


def _walk(row: Row) -> Walk:
    kept = {"evidence": Evidence.from_row(row["evidence"]), "apart": np.array(row["apart"])}
    return Walk(**row | kept | {"reasons": ()})
