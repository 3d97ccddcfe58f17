"""What all settings have in common; each class of settings lives beside the code it sets."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field


class Settings(BaseModel):
    """Values that are checked when they are made, refuse unknown names and never change."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def ascending(*, strictly: bool = False) -> AfterValidator:
    """The rule that a pair of numbers ascends; ``strictly`` refuses equal ones too."""

    def check(pair: tuple[float, float]) -> tuple[float, float]:
        low, high = pair
        if low > high or (strictly and low == high):
            raise ValueError(f"must ascend, got ({low}, {high}); swap its two values")
        return pair

    return AfterValidator(check)


Finite = Annotated[float, Field(allow_inf_nan=False)]
"""Any number but infinity and NaN."""

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
"""A finite number above 0."""

NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
"""A finite number from 0 up."""

Share = Annotated[float, Field(gt=0.0, lt=1.0)]
"""A part of a whole, neither nothing nor all."""

Count = Annotated[int, Field(ge=1)]
"""How many, at least one."""

Seed = Annotated[int, Field(ge=0, lt=2**63)]
"""Seed of random streams."""

PositiveRange = Annotated[tuple[Positive, Positive], ascending()]
"""Least and greatest of what is positive; they may be equal."""
