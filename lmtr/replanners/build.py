"""The paper's three replanners from what is stored: a model and the expert's segments."""

from lmtr.errors import ModelError
from lmtr.models.data import TrainingData
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.policies.mode_library import mode_library
from lmtr.policies.mode_policy import ModePolicy, NearestModePolicy
from lmtr.replanners.latent_mode import LatentModeReplanner
from lmtr.replanners.replanner import Replanner
from lmtr.replanners.selecting import SelectingReplanner, Selection
from lmtr.replanners.trajectory_library import TrajectoryLibraryReplanner
from lmtr.replanners.unimodal import UnimodalReplanner
from lmtr.robot.model import RobotModel
from lmtr.vectors.layout import TASK_LAYOUT
from lmtr.vectors.scaling import Standardiser


def build_replanner(
    model: TrainedModel | None,
    library: TrainingData,
    weights: TaskWeights,
    *,
    policy: ModePolicy | None = None,
    selection: Selection | None = None,
    robot: RobotModel | None = None,
) -> Replanner:
    """The replanner that a model, or the want of one, stands for.

    Args:
        model: With n ≥ 1 it makes LMTR, with n = 0 the unimodal regressor; None makes the
            trajectory library.
        library: Expert segments to look up; the unimodal regressor needs none of them.
        weights: w of the task distance; the unimodal regressor has no use for it.
        policy: Selects LMTR's modes; π_nbr by default.
        selection: Choose among the plans of several nearest tasks.
        robot: Whose range of motion selection is about; the model's own by default.

    Raises:
        ModelError: There is nothing to select from, or no robot to select for.
    """
    made = _plain(model, library, weights, policy)
    if selection is None:
        return made
    robot = robot or (None if model is None else model.robot)
    if isinstance(made, UnimodalReplanner) or policy is not None or robot is None:
        raise ModelError(
            f"replanner {made.name!r} cannot be selected from: it takes several nearest tasks, and "
            "a robot whose range of motion the plans shall keep"
        )
    return SelectingReplanner(made, selection, robot)


def _plain(
    model: TrainedModel | None,
    library: TrainingData,
    weights: TaskWeights,
    policy: ModePolicy | None,
) -> UnimodalReplanner | LatentModeReplanner | TrajectoryLibraryReplanner:
    if model is None:
        scaling = Standardiser.fit(TASK_LAYOUT, library.x)
        return TrajectoryLibraryReplanner(library.x, library.tau, weights, scaling)
    if model.latent == 0:
        return UnimodalReplanner(model)
    if policy is not None:
        return LatentModeReplanner(model, policy)
    modes = mode_library(model, library.x, library.tau)
    return LatentModeReplanner(model, NearestModePolicy(modes, weights, model.task_scaling))
