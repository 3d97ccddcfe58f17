"""Settings of the CVAE and of its training (Sec. 3.2, 4.3)."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from lmtr.models.weighting import LossWeights
from lmtr.settings import Count, NonNegative, Positive, Seed, Settings

Activation = Literal["elu", "relu", "tanh"]


class ModelSettings(Settings):
    """What the CVAE is and what it is fitted to.

    ``kappa`` means nothing without ``reduction`` and the scaling of τ: with the L1 norm as a sum
    over 264 standardised dimensions, κ = 0.001 leaves nearly a plain autoencoder, while as a mean
    it leaves about two nats per active dimension. So the three are stored with every model.

    Attributes:
        latent: n, dimensions of the mode z; 0 is the unimodal regressor.
        hidden: Hidden layers of the decoder; the encoder has them reversed.
        activation: Nonlinearity after each hidden layer; the paper names none.
        kappa: κ, weight of the KL divergence in Eq. 5.
        reduction: Over the standardised dimensions of τ, the L1 error's mean or (Eq. 5 to the
            letter) its sum.
        loss_weights: What the L1 error is measured in, by category of τ.
        task_noise: Standard deviation of the Gaussian noise on task inputs in training, in units
            of each task dimension's standard deviation; the paper's 1 %.
    """

    latent: Annotated[int, Field(ge=0)] = 6
    hidden: tuple[Count, ...] = (64, 64, 264, 264)
    activation: Activation = "elu"
    kappa: NonNegative = 0.001
    reduction: Literal["mean", "sum"] = "mean"
    loss_weights: LossWeights = LossWeights()
    task_noise: NonNegative = 0.01

    @model_validator(mode="after")
    def _mode_passes_the_layers(self) -> "ModelSettings":
        if not self.hidden:
            raise ValueError("hidden must name at least one layer, got (); the paper has 4")
        if self.latent > min(self.hidden):
            raise ValueError(
                f"latent = {self.latent} exceeds the narrowest hidden layer of {self.hidden}, "
                f"which cannot pass it on; take at most {min(self.hidden)} or widen the layers"
            )
        return self

    @property
    def name(self) -> str:
        """The paper's name of the model, LMTR-n or unimodal."""
        return f"LMTR-{self.latent}" if self.latent else "unimodal"


class TrainingSettings(Settings):
    """How the CVAE is fitted, with Adam on Eq. 5.

    Attributes:
        epochs: Passes over the training data at most.
        batch_size: Segments per step.
        learning_rate: The schedule's peak.
        schedule: ``one_cycle`` warms up over the first 30 % and then anneals; ``cosine`` starts
            at the peak and anneals.
        validate_every: Epochs between two looks at the validation data.
        patience: Epochs without a better validation loss before training stops; None never stops
            early.
        seed: Of the weights, the order of the data and all noise.
        threads: Threads of torch; models are trained side by side, so one each.
        device: ``auto`` takes a GPU where there is one.
    """

    epochs: Count = 80
    batch_size: Count = 512
    learning_rate: Positive = 4e-3
    schedule: Literal["one_cycle", "cosine"] = "one_cycle"
    validate_every: Count = 2
    patience: Count | None = 20
    seed: Seed = 0
    threads: Count = 1
    device: Literal["auto", "cpu", "cuda"] = "auto"

    @model_validator(mode="after")
    def _validation_comes_in_time(self) -> "TrainingSettings":
        if self.validate_every > self.epochs:
            raise ValueError(
                f"validate_every = {self.validate_every} exceeds epochs = {self.epochs}, so no "
                "weights would ever be compared; validate at least once in all epochs"
            )
        if self.patience is not None and self.patience < self.validate_every:
            raise ValueError(
                f"patience = {self.patience} epochs is shorter than validate_every = "
                f"{self.validate_every}; be patient for at least one validation"
            )
        return self


class ModeRegressorSettings(Settings):
    """How π_N is fitted, with Adam and a cosine schedule.

    Attributes:
        hidden: Hidden layers.
        epochs: Passes over the data.
        batch_size: Tasks per step.
        learning_rate: At the beginning.
        seed: Of the weights and the order of the data.
    """

    hidden: tuple[Count, ...] = (128, 128)
    epochs: Count = 30
    batch_size: Count = 512
    learning_rate: Positive = 2e-3
    seed: Seed = 0
