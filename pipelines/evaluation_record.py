"""What is kept of a trial: a run of the tracker, its rollouts and its summary in the lake."""

from dataclasses import dataclass, field
from typing import Any

from lmtr.figures.motion_figure import motion_figure
from pipelines import records
from pipelines.expert_courses import Walked
from pipelines.learning_data import LearningData
from pipelines.provenance import code_version
from pipelines.rollout_worker import Tried
from pipelines.sections import EvaluationSection
from pipelines.trials import CHOICES, EXPERT, Trial
from pipelines.workspace import Workspace

EXPERIMENT = "evaluation"


TRIALS_PER_COMMIT = 16
"""So many trials of a search are committed together: with a commit each, hundreds of small files
would slow every later one down."""


@dataclass(frozen=True)
class Recorder:
    """Keeps what comes out of trials: in the tracker, and in the lake.

    Trials of a search wait for others to be committed with; :meth:`flush` commits them.

    Attributes:
        section: The evaluation, on the courses of these trials.
        workspace: The home.
        experiment: Id of the tracker's experiment.
        data: What was looked up.
    """

    section: EvaluationSection
    workspace: Workspace
    experiment: str
    data: LearningData
    _rollouts: list[records.Row] = field(default_factory=list, init=False)
    _evaluations: list[records.Row] = field(default_factory=list, init=False)

    def __call__(self, trial: Trial, tried: Tried, run_id: str | None = None) -> None:
        """Keep a trial: its rollouts, and last the evaluation that makes them count.

        Args:
            trial: The trial.
            tried: What came out of it.
            run_id: Run of the tracker that it belongs to; None makes one for it alone.
        """
        metrics = {**records.summary_metrics(tried.summary), "nbytes": float(tried.nbytes)}
        name = trial.evaluation_id
        run_id = run_id or self._log(trial, tried, metrics)
        rows = [self._rollout_row(name, trial.label, row) for row in tried.rows]
        row = {
            "replanner": trial.label,
            "model_id": trial.model_id,
            "policy": trial.policy,
            "latent": trial.latent,
            "training_seed": trial.training_seed,
            "purpose": trial.purpose,
            "weights": list(trial.weights.values),
            "planner": records.to_json(tried.planner),
        }
        self._take(name, rows, row, metrics, run_id)
        if trial.purpose == "report" or len(self._evaluations) >= TRIALS_PER_COMMIT:
            self.flush()

    def keep_expert(self, evaluation_id: str, walked: Walked, planner: dict[str, Any]) -> None:
        """Keep how the expert walked the courses, as an evaluation without weights or model."""
        metrics = records.summary_metrics(walked.summary)
        parameters = {
            "replanner": EXPERT,
            "courses": len(walked.rows),
            **self.section.model_dump(mode="json", exclude=CHOICES),
            **self.data.provenance,
        }
        tags = {
            "evaluation_id": evaluation_id,
            "code_version": code_version(),
            "stage": "evaluate",
        }
        with self.workspace.tracker.run(self.experiment, evaluation_id, parameters, tags) as run:
            run.metrics((key, value, 0) for key, value in metrics.items())
        rows = [self._rollout_row(evaluation_id, EXPERT, row) for row in walked.rows]
        row = {
            "replanner": EXPERT,
            "policy": EXPERT,
            "purpose": "report",
            "weights": [],
            "planner": records.to_json(planner),
        }
        self._take(evaluation_id, rows, row, metrics, str(run.id))
        self.flush()

    def flush(self) -> None:
        """Append what waits: rollouts first, and then the evaluations that make them count."""
        lake = self.workspace.lake
        # Whoever may append one of these rows does so under the same name.
        for table, rows in (("rollouts", self._rollouts), ("evaluations", self._evaluations)):
            if rows:
                lake.append_rows(table, rows, app_id=f"{table}/{self.data.dataset_id}")
        self._rollouts.clear()
        self._evaluations.clear()

    def _take(
        self,
        evaluation_id: str,
        rollouts: list[records.Row],
        row: records.Row,
        metrics: dict[str, float],
        run_id: str,
    ) -> None:
        """Put an evaluation and its rollouts with what waits to be appended."""
        self._rollouts.extend(rollouts)
        self._evaluations.append(
            {
                "evaluation_id": evaluation_id,
                "dataset_id": self.data.dataset_id,
                "segmentation_id": self.data.segmentation_id,
                "settings": self.section.model_dump_json(exclude=CHOICES),
                "seed": self.section.seed,
                "summary": list(metrics.items()),
                "segments_version": self.data.version,
                "mlflow_run_id": run_id,
                "code_version": code_version(),
                "created_at": records.now(),
                **row,
            }
        )

    def _rollout_row(self, evaluation_id: str, replanner: str, row: records.Row) -> records.Row:
        return {
            "rollout_id": f"{evaluation_id}-{row['index']:03d}",
            "evaluation_id": evaluation_id,
            "dataset_id": self.data.dataset_id,
            "replanner": replanner,
            "created_at": records.now(),
            **row,
        }

    def _log(self, trial: Trial, tried: Tried, metrics: dict[str, float]) -> str:
        """Log one run of the tracker; returns its id."""
        parameters = {
            "replanner": trial.label,
            "model_id": trial.model_id or "",
            "latent": "" if trial.latent is None else trial.latent,
            "training_seed": "" if trial.training_seed is None else trial.training_seed,
            "weight": trial.weights.model_dump(),
            "policy": trial.policy,
            **self.section.model_dump(mode="json", exclude=CHOICES),
            **self.data.provenance,
        }
        tags = {
            "evaluation_id": trial.evaluation_id,
            "code_version": code_version(),
            "stage": "evaluate",
        }
        tracker = self.workspace.tracker
        with tracker.run(self.experiment, trial.evaluation_id, parameters, tags) as run:
            run.metrics((key, value, 0) for key, value in metrics.items())
            shown = tried.shown
            if shown is not None and len(shown.motion.times) > 1:
                figure = motion_figure(shown.motion, shown.obstacles_W, trial.label)
                run.figure(figure, "rollout.png")
        return str(run.id)
