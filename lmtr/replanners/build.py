"""The paper's three replanners from what is stored: a model and the expert's segments."""

from lmtr.models.data import TrainingData
from lmtr.models.trained import TrainedModel
from lmtr.policies.distance import TaskWeights
from lmtr.policies.mode_library import mode_library
from lmtr.policies.mode_policy import NearestModePolicy
from lmtr.replanners.latent_mode import LatentModeReplanner
from lmtr.replanners.replanner import Replanner
from lmtr.replanners.trajectory_library import TrajectoryLibraryReplanner
from lmtr.replanners.unimodal import UnimodalReplanner
from lmtr.vectors.layout import TASK_LAYOUT
from lmtr.vectors.scaling import Standardiser


def build_replanner(
    model: TrainedModel | None, library: TrainingData, weights: TaskWeights
) -> Replanner:
    """The replanner that a model, or the want of one, stands for.

    Args:
        model: With n ≥ 1 it makes LMTR with π_nbr, with n = 0 the unimodal regressor; None makes
            the trajectory library.
        library: Expert segments to look up; the unimodal regressor needs none of them.
        weights: w of the task distance; the unimodal regressor has no use for it.
    """
    if model is None:
        scaling = Standardiser.fit(TASK_LAYOUT, library.x)
        return TrajectoryLibraryReplanner(library.x, library.tau, weights, scaling)
    if model.latent == 0:
        return UnimodalReplanner(model)
    modes = mode_library(model, library.x, library.tau)
    return LatentModeReplanner(model, NearestModePolicy(modes, weights, model.task_scaling))
