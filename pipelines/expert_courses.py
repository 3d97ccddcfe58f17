"""The expert on the courses of the rollouts, solved offline: the line of reference (Sec. 5)."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lmtr.arrays import Array
from lmtr.errors import ModelError
from lmtr.expert.solve import Solution
from lmtr.quality.filter import expected_cost, judge
from lmtr.quality.measure import measure
from lmtr.quality.status import Status
from lmtr.rollout.balance import mean_residuals
from lmtr.rollout.courses import Course, random_courses
from lmtr.rollout.metrics import forward_violation, obstacle_clearances
from lmtr.rollout.stretches import Stretch, stretches
from lmtr.rollout.summary import ReplannerSummary, pooled, residual_percentiles
from lmtr.rollout.tally import Tally
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import sample_noise
from lmtr.trajectory.motion import sampled
from lmtr.trajectory.trajectory import BASE_STEP
from pipelines.config import Configuration, fingerprint
from pipelines.expert import build_expert, told
from pipelines.learning_data import LearningData
from pipelines.progress import bar, say
from pipelines.records import Row
from pipelines.rollout_worker import NO_MOTION, UNKEPT
from pipelines.sections import EvaluationSection
from pipelines.trials import CHOICES, EXPERT
from pipelines.workspace import Workspace
from services.cache import machine_cache

ATTEMPTS = 4
"""Draws of the noise ξ̄ per stretch; the first that the filter accepts is taken."""

NOT_SOLVED = "not_solved"
"""Why a course counts as fallen: no draw converged on one of its stretches."""


@dataclass(frozen=True)
class Walk:
    """How the expert walked one course.

    Attributes:
        row: Columns of its row of table ``rollouts``.
        tally: The sums in it.
        residuals: Linear and angular, of each stretch that was solved.
    """

    row: Row
    tally: Tally
    residuals: list[tuple[Array, Array]]


@dataclass(frozen=True)
class Walked:
    """How the expert walked the courses.

    Attributes:
        rows: Columns of table ``rollouts``, one row for each course.
        summary: Aggregate performance; it never replans, so jumps are NaN.
    """

    rows: list[Row]
    summary: ReplannerSummary


def expert_id(section: EvaluationSection, data: LearningData) -> str:
    """Identity of the expert's evaluation: data set, testbed and number of courses."""
    testbed = section.model_dump(mode="json", exclude=CHOICES)
    return f"{EXPERT}-{fingerprint(data.dataset_id, section.expert_courses, testbed)}"


def walk_courses(
    section: EvaluationSection, made_with: Configuration, workspace: Workspace
) -> Walked:
    """Solve the first ``section.expert_courses`` courses on workers.

    Args:
        section: Courses and criteria.
        made_with: The data set's settings, its expert's among them.
        workspace: Where workers come from.

    Raises:
        ModelError: A course failed outside the optimizer.
    """
    settings = made_with.model_copy(update={"cluster": workspace.cluster_settings})
    news = told(build_expert(settings).build_report, machine_cache(settings.cluster.cache))
    if news:
        say(f"evaluate: {news}")
    courses = random_courses(section.rollout, section.seed, range(section.expert_courses))
    make_worker = functools.partial(CourseWorker, section, settings)
    walks: list[Walk] = []
    with (
        workspace.cluster(len(courses)) as cluster,
        bar("Solving courses", len(courses)) as progress,
    ):
        for outcome in cluster.stream(make_worker, courses):
            if outcome.error is not None:
                raise ModelError(
                    f"evaluate: the expert failed on course {outcome.item.index} "
                    f"({outcome.error}); set evaluation.expert_courses to 0 to go without it"
                )
            walks.append(outcome.value)
            progress.advance(note=f"course {outcome.item.index}")
    walks.sort(key=lambda walk: int(walk.row["index"]))
    return Walked([walk.row for walk in walks], _summary(walks))


def _summary(walks: Sequence[Walk]) -> ReplannerSummary:
    nothing = float("nan")
    residuals = [each for walk in walks for each in walk.residuals]
    linear, angular = residual_percentiles(residuals) if residuals else (nothing, nothing)
    return ReplannerSummary(
        replanner=EXPERT,
        performance=pooled([walk.tally for walk in walks]),
        diverged=int(sum(walk.tally.falls for walk in walks)),
        reasons={},
        linear_residual_p95=linear,
        angular_residual_p95=angular,
        velocity_jump=nothing,
        foot_jump=nothing,
        disagreement_share=nothing,
        disagreements={},
        plan_seconds=float(np.median(np.concatenate([walk.row["plan_seconds"] for walk in walks]))),
    )


class CourseWorker:
    """Walks courses in a worker process, which holds the compiled expert."""

    def __init__(self, section: EvaluationSection, settings: Configuration) -> None:
        self._section = section
        self._settings = settings
        self._robot = settings.dataset.robot
        self._expert = build_expert(settings)
        self._cost_key = settings.expert.cost_key(self._robot)

    def __call__(self, course: Course) -> Walk:
        """Walk one course, a stretch at a time."""
        settings, criteria = self._settings, self._section.criteria
        parts = stretches(course, self._length(), settings.tasks, self._robot)
        rng = stream(course.seed, Purpose.REFERENCE, course.index)
        solved = [self._solved(part, rng) for part in parts]
        tallies, residuals, clearances, violations = [], [], [], []
        for part, (solution, _) in zip(parts, solved, strict=True):
            if solution is None:
                continue
            motion = sampled(solution.trajectory, BASE_STEP)
            tallies.append(Tally.of(motion, part.judged_W, self._robot, criteria))
            residuals.append(mean_residuals(motion, self._robot))
            clearances += obstacle_clearances(motion, part.judged_W).ravel().tolist()
            violation = forward_violation(motion, self._robot, criteria.forward_limit)
            violations += violation[motion.contact].tolist()
        fell = len(tallies) < len(parts)
        tally = Tally.joined(tallies, fell=fell)
        row = {
            **UNKEPT,
            **NO_MOTION,
            "index": course.index,
            "seed": course.seed,
            "outcome": "diverged" if fell else "completed",
            "reason": NOT_SOLVED if fell else None,
            "duration_s": tally.duration,
            "distance_m": tally.distance,
            "obstacles": course.obstacles_W.ravel().tolist(),
            "metrics": list(tally.as_dict().items()),
            "clearances": clearances,
            "violations": violations,
            "plan_seconds": [seconds for _, seconds in solved],
        }
        return Walk(row, tally, residuals)

    def _length(self) -> float:
        """As far as the expert's own tasks would bring it in the time of a rollout (m)."""
        tasks, scope = self._settings.tasks, self._settings.expert.scope
        speed = float(np.mean(tasks.goal_distance)) / scope.duration
        return speed * self._section.rollout.duration

    def _solved(self, part: Stretch, rng: np.random.Generator) -> tuple[Solution | None, float]:
        """The first accepted solution, else one that converged, and the time of all solves (s)."""
        settings, seconds = self._settings, 0.0
        converged: Solution | None = None
        for _ in range(ATTEMPTS):
            noise = sample_noise(settings.tasks, settings.expert.scope.n_swings, rng)
            solution = self._expert.solve(part.task, noise)
            seconds += solution.solve_cpu_s
            if solution.status is not Status.CONVERGED:
                continue
            converged = solution
            if self._is_accepted(part, solution):
                break
        return converged, seconds

    def _is_accepted(self, part: Stretch, solution: Solution) -> bool:
        quality, lines_W = self._settings.quality, part.task.obstacles_W
        violations = measure(solution.trajectory, self._robot, lines_W)
        expected = expected_cost(part.task, self._robot, self._cost_key, quality)
        return judge(
            str(solution.status),
            solution.cost,
            expected,
            violations,
            quality,
            solution.saturated,
        ).accepted
