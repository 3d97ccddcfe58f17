"""The search for weights w: which replanners are tuned, and what their rollouts speak for."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

import numpy as np

from lmtr.errors import DataError
from lmtr.policies.distance import TaskWeights
from lmtr.rollout.fronts import chosen
from pipelines.learning_data import LearningData
from pipelines.progress import say
from pipelines.provenance import code_version
from pipelines.registry import Registered
from pipelines.rollout_worker import Tried
from pipelines.sections import EvaluationSection
from pipelines.trials import CHOICES, LIBRARY, Trial, in_words
from pipelines.workspace import Workspace
from services.lake.tables import Lake
from services.tracking.run import Run


def tuned_models(section: EvaluationSection, models: Sequence[Registered]) -> list[Registered]:
    """The models whose w is searched for: the first of each latent dimension that is tuned.

    Raises:
        DataError: A latent dimension is to be tuned that no model has.
    """
    if section.tuning is None:
        return []
    first: dict[int, Registered] = {}
    for model in models:
        if model.latent > 0:
            first.setdefault(model.latent, model)
    wanted = section.tuning.latent or tuple(first)
    unknown = [latent for latent in wanted if latent not in first]
    if unknown:
        raise DataError(
            f"evaluate: evaluation.tuning.latent names {unknown}, but the models that look tasks "
            f"up have {sorted(first) or 'not been trained'}; train those too or leave them out"
        )
    return [first[latent] for latent in wanted]


def choose(
    section: EvaluationSection, lake: Lake, trials: Sequence[Trial]
) -> dict[int | None, list[TaskWeights]]:
    """The weights of each tuned replanner, off the Pareto front of its rollouts; says which.

    Args:
        section: How many are kept.
        lake: Where the rollouts' summaries lie.
        trials: The search, rolled out.
    """
    tuning = section.tuning
    if tuning is None or not trials:
        return {}
    names = ", ".join(f"'{trial.evaluation_id}'" for trial in trials)
    rows = lake.read(
        "evaluations", ["evaluation_id", "summary"], where=f"evaluation_id IN ({names})"
    ).to_pylist()
    summaries = {row["evaluation_id"]: dict(row["summary"]) for row in rows}
    by_latent: dict[int | None, list[Trial]] = defaultdict(list)
    for trial in trials:
        by_latent[trial.latent].append(trial)
    found: dict[int | None, list[TaskWeights]] = {}
    for latent, tried in by_latent.items():
        of_each = [summaries[trial.evaluation_id] for trial in tried]
        points = np.array([[each["close_share"], each["mean_violation"]] for each in of_each])
        fallen = np.array([each["diverged"] > 0.0 for each in of_each])
        kept = chosen(points, fallen, tuning.points)
        found[latent] = [tried[number].weights for number in kept]
        _tell(LIBRARY if latent is None else f"LMTR-{latent}", tried, points, fallen, kept.tolist())
    return found


def _tell(
    name: str, tried: Sequence[Trial], points: np.ndarray, fallen: np.ndarray, kept: list[int]
) -> None:
    """What was chosen, in a line for each w."""
    falls = f", {int(fallen.sum())} of them with falls" if fallen.any() else ""
    say(f"evaluate: {name}: {len(kept)} of {len(tried)} w's chosen{falls}")
    for number in kept:
        close, violation = points[number]
        say(
            f"evaluate:   w={in_words(tried[number].weights)}: {100 * close:.1f} % close steps, "
            f"{1e3 * violation:.3f} mm violation on the tuning courses"
        )


class TuningRuns:
    """Runs of the tracker, one for each replanner that is tuned; a step is a w of the grid.

    A run for each of hundreds of w's would take longer than their rollouts.
    """

    def __init__(self, runs: dict[int | None, Run], grid: list[TaskWeights]) -> None:
        self._runs = runs
        self._grid = grid

    def log(self, trial: Trial, tried: Tried) -> str:
        """Log what came out for a w; returns the id of the replanner's run."""
        run, step = self._runs[trial.latent], self._grid.index(trial.weights)
        found = tried.summary.performance
        values = {
            **trial.weights.model_dump(),
            "close_share": found.close_share.value,
            "mean_violation": found.mean_violation.value,
            "distance": found.distance.value,
            "diverged": float(tried.summary.diverged),
        }
        run.metrics((key, float(value), step) for key, value in values.items())
        return str(run.id)


@contextmanager
def tuning_runs(
    section: EvaluationSection,
    workspace: Workspace,
    experiment: str,
    data: LearningData,
    trials: Sequence[Trial],
) -> Iterator[TuningRuns]:
    """Begin the runs of the replanners that these trials are about, and end them with the block.

    Args:
        section: The evaluation on the courses of the tuning.
        workspace: The home.
        experiment: Id of the tracker's experiment.
        data: What was looked up.
        trials: What is about to be rolled out.
    """
    with ExitStack() as stack:
        runs = {}
        for trial in trials:
            if trial.latent in runs:
                continue
            name = LIBRARY if trial.latent is None else f"LMTR-{trial.latent}"
            parameters = {
                "replanner": name,
                "model_id": trial.model_id or "",
                "weights": [in_words(each) for each in section.weights],
                **section.model_dump(mode="json", exclude=CHOICES),
                **data.provenance,
            }
            tags = {"code_version": code_version(), "stage": "evaluate", "purpose": "tuning"}
            runs[trial.latent] = stack.enter_context(
                workspace.tracker.run(experiment, f"tuning {name}", parameters, tags)
            )
        yield TuningRuns(runs, list(section.weights))
