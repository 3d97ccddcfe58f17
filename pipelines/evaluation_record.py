"""What is kept of a trial: a run of the tracker, its rollouts and its summary in the lake."""

from dataclasses import dataclass

from lmtr.figures.motion_figure import motion_figure
from pipelines import records
from pipelines.learning_data import LearningData
from pipelines.provenance import code_version
from pipelines.rollout_worker import Tried
from pipelines.sections import EvaluationSection
from pipelines.trials import CHOICES, Trial
from pipelines.workspace import Workspace

EXPERIMENT = "evaluation"


@dataclass(frozen=True)
class Recorder:
    """Keeps what comes out of trials: in the tracker, and in the lake.

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

    def __call__(self, trial: Trial, tried: Tried, run_id: str | None = None) -> None:
        """Keep a trial: its rollouts, and last the evaluation that makes them count.

        Args:
            trial: The trial.
            tried: What came out of it.
            run_id: Run of the tracker that it belongs to; None makes one for it alone.
        """
        metrics = {**records.summary_metrics(tried.summary), "nbytes": float(tried.nbytes)}
        lake, name = self.workspace.lake, trial.evaluation_id
        run_id = run_id or self._log(trial, tried, metrics)
        rows = [self._rollout_row(trial, row) for row in tried.rows]
        lake.append_rows("rollouts", rows, app_id=f"rollouts/{name}")
        row = self._evaluation_row(trial, tried, metrics, run_id)
        lake.append_rows("evaluations", [row], app_id=f"evaluations/{name}")

    def _evaluation_row(
        self, trial: Trial, tried: Tried, metrics: dict[str, float], run_id: str
    ) -> records.Row:
        return {
            "evaluation_id": trial.evaluation_id,
            "dataset_id": self.data.dataset_id,
            "segmentation_id": self.data.segmentation_id,
            "replanner": trial.label,
            "model_id": trial.model_id,
            "policy": trial.policy,
            "latent": trial.latent,
            "training_seed": trial.training_seed,
            "purpose": trial.purpose,
            "weights": list(trial.weights.values),
            "planner": records.to_json(tried.planner),
            "settings": self.section.model_dump_json(exclude=CHOICES),
            "seed": self.section.seed,
            "summary": list(metrics.items()),
            "segments_version": self.data.version,
            "mlflow_run_id": run_id,
            "code_version": code_version(),
            "created_at": records.now(),
        }

    def _rollout_row(self, trial: Trial, row: records.Row) -> records.Row:
        return {
            "rollout_id": f"{trial.evaluation_id}-{row['index']:03d}",
            "evaluation_id": trial.evaluation_id,
            "dataset_id": self.data.dataset_id,
            "replanner": trial.label,
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
