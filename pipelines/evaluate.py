"""Stage 4: roll out every replanner over the same random courses; log and keep what came out.

Where weights w are searched for, their grid is walked first, on courses of its own; what it speaks
for is then evaluated with the rest on the courses that are reported.
"""

import functools
from collections.abc import Callable, Sequence

from lmtr.errors import ModelError
from lmtr.rollout.summary import ReplannerSummary
from pipelines.config import Configuration
from pipelines.datasets import configuration_of
from pipelines.evaluation_record import EXPERIMENT, Recorder
from pipelines.expert_courses import expert_id, walk_courses
from pipelines.learning_data import LearningData
from pipelines.progress import bar, say
from pipelines.registry import Registered, load, models
from pipelines.rollout_worker import RolloutWorker, Tried
from pipelines.sections import EvaluationSection
from pipelines.trials import Chosen, Trial, trials
from pipelines.tuning import choose, tuned_models, tuning_runs
from pipelines.turns import beside_others
from pipelines.workspace import Workspace
from services.lake.housekeeping import join_files
from services.lake.tables import Lake


def evaluate(
    config: Configuration,
    workspace: Workspace,
    data: LearningData,
    model_ids: Sequence[str] | None = None,
) -> list[str]:
    """Roll out what has not been; returns the ids of all evaluations that are reported.

    Args:
        config: Rollouts, weights, testbed.
        workspace: The home.
        data: The data set; its validation split gives the starts.
        model_ids: Models to evaluate; None for all of the data set.

    Raises:
        DataError: There is no model, or none of a latent dimension that is to be tuned.
        ModelError: Some replanner failed; what the others gave is kept.
    """
    section = config.evaluation
    known = models(workspace, data.dataset_id, data.segmentation_id, model_ids)
    chosen = _tuned(section, workspace, data, known)
    wanted = trials(section, data, known, chosen)
    if not _rolled_out("Rolling out", section, workspace, data, wanted):
        say(f"evaluate: all {len(wanted)} replanners are evaluated already")
    if section.expert_courses > 0:
        _expert_walked(section, workspace, data)
    return [trial.evaluation_id for trial in wanted]


def _tuned(
    section: EvaluationSection,
    workspace: Workspace,
    data: LearningData,
    known: Sequence[Registered],
) -> Chosen:
    """The weights that the search speaks for, after walking what is missing of its grid."""
    tuned = tuned_models(section, known)
    if section.tuning is None:
        return {}
    search = section.for_tuning()
    wanted = trials(search, data, tuned, purpose="tuning")
    _rolled_out("Searching w", search, workspace, data, wanted)
    return choose(section, workspace.lake, wanted)


def _rolled_out(
    title: str,
    section: EvaluationSection,
    workspace: Workspace,
    data: LearningData,
    wanted: Sequence[Trial],
) -> int:
    """Roll out those of the trials that have not been; returns how many."""
    done = _evaluated(workspace.lake)
    missing = [trial for trial in wanted if trial.evaluation_id not in done]
    if missing:
        with beside_others(workspace.home, "evaluate", shared=True):
            _roll_out(title, section, workspace, data, missing)
    return len(missing)


def _evaluated(lake: Lake) -> set[str]:
    """Evaluations that are whole in the lake; a repair may have taken out the rollouts of one."""
    done = set(lake.values("evaluations", "evaluation_id"))
    return done & set(lake.values("rollouts", "evaluation_id"))


def _roll_out(
    title: str,
    section: EvaluationSection,
    workspace: Workspace,
    data: LearningData,
    missing: list[Trial],
) -> None:
    robot = configuration_of(workspace, data.dataset_id).dataset.robot
    used = {trial.model_id for trial in missing if trial.model_id is not None}
    loaded = {model_id: load(workspace, model_id) for model_id in sorted(used)}
    experiment = workspace.tracker.experiment(EXPERIMENT)
    make_worker = functools.partial(RolloutWorker, data, loaded, robot, section)
    record = Recorder(section, workspace, experiment, data)
    searching = [trial for trial in missing if trial.purpose == "tuning"]
    with tuning_runs(section, workspace, experiment, data, searching) as runs:

        def keep(trial: Trial, tried: Tried) -> None:
            if trial.purpose == "tuning":
                record(trial, tried, runs.log(trial, tried))
            else:
                record(trial, tried)
                say(f"evaluate: {trial.evaluation_id}: {_result(tried.summary)}")

        try:
            _distribute(title, workspace, make_worker, missing, keep)
        finally:  # what came back is kept, however this ends
            record.flush()
    for table in ("rollouts", "evaluations"):
        join_files(workspace.lake, table)


def _expert_walked(section: EvaluationSection, workspace: Workspace, data: LearningData) -> None:
    """Let the expert walk the first courses, unless it has."""
    made_with = configuration_of(workspace, data.dataset_id)
    evaluation_id = expert_id(section, data)
    if evaluation_id in _evaluated(workspace.lake):
        return
    with beside_others(workspace.home, "evaluate", shared=True):
        experiment = workspace.tracker.experiment(EXPERIMENT)
        record = Recorder(section, workspace, experiment, data)
        walked = walk_courses(section, made_with, workspace)
        planner = {"expert": made_with.expert.model_dump(mode="json")}
        record.keep_expert(evaluation_id, walked, planner)
    say(f"evaluate: {evaluation_id}: {_result(walked.summary)}")


def _distribute(
    title: str,
    workspace: Workspace,
    make_worker: Callable[[], RolloutWorker],
    missing: list[Trial],
    keep: Callable[[Trial, Tried], None],
) -> None:
    """Send trials to workers and keep what comes back.

    Raises:
        ModelError: Some failed.
    """
    failed: list[str] = []
    with workspace.cluster(len(missing)) as cluster, bar(title, len(missing)) as progress:
        for outcome in cluster.stream(make_worker, missing):
            if outcome.error is None:
                keep(outcome.item, outcome.value)
            else:
                failed.append(f"{outcome.item.label} ({outcome.error})")
            progress.advance(note=outcome.item.label)
    if failed:
        raise ModelError(f"evaluate: failed for {'; '.join(failed)}; the others are kept")


def _result(summary: ReplannerSummary) -> str:
    """The finding in a few words."""
    found = summary.performance
    return (
        f"{100 * found.close_share.value:.1f} % close steps, "
        f"{1e3 * found.mean_violation.value:.3f} mm violation, {summary.diverged} diverged"
    )
