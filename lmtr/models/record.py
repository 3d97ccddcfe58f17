"""The history of one training, epoch by epoch, as it is reported and stored."""

from lmtr.models.reconstruction import ReconstructionErrors
from lmtr.settings import Count, Settings


class ValidationRecord(Settings):
    """What the model does on data it has not seen.

    Attributes:
        loss: Eq. 5 with sampled modes and clean tasks; the noise is the same at every look, so
            that two epochs differ by their weights alone.
        reconstruction: Its L1 term, in standardised units.
        kl: Its divergence (nats).
        active_dimensions: Dimensions of z in use.
        errors: Errors of reconstructions from the mean mode μ, in physical units.
    """

    loss: float
    reconstruction: float
    kl: float
    active_dimensions: int
    errors: ReconstructionErrors


class EpochRecord(Settings):
    """One pass over the training data.

    Attributes:
        epoch: Counted from 1.
        learning_rate: At its end.
        loss: Eq. 5, mean over its batches.
        reconstruction: Its L1 term, in standardised units.
        kl: Its divergence (nats).
        validation: The look at the validation data after it, where there was one.
    """

    epoch: Count
    learning_rate: float
    loss: float
    reconstruction: float
    kl: float
    validation: ValidationRecord | None = None
