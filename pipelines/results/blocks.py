"""What a results page is made of: tables whose numbers know where they come from, figures, text."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, isfinite

from matplotlib.figure import Figure

from lmtr.rollout.comparison import Ratio
from lmtr.rollout.summary import Estimate
from pipelines.report.page import format_cell


@dataclass(frozen=True)
class Measure:
    """A number with its interval.

    Attributes:
        value: The number, in the unit of its column.
        low: Lower end of its 95 % interval, or None.
        high: Upper end, or None.
        at_least: Whether the value is a lower bound.
    """

    value: float
    low: float | None = None
    high: float | None = None
    at_least: bool = False

    @classmethod
    def of(cls, found: Estimate | Ratio, scale: float = 1.0) -> "Measure":
        """An estimate or ratio in another unit."""
        return cls(
            scale * found.value,
            scale * found.low,
            scale * found.high,
            isinstance(found, Ratio) and found.at_least,
        )

    def __str__(self) -> str:
        """The number, and behind it its interval."""
        if self.value == inf:
            text = "∞"
        else:
            text = ("≥ " if self.at_least else "") + format_cell(float(self.value))
        if self.low is None or self.high is None or not isfinite(self.low):
            return text
        high = format_cell(float(self.high)) if isfinite(self.high) else "∞"
        return f"{text} ({format_cell(float(self.low))}–{high})"

    def as_json(self) -> dict[str, object]:
        """Plain types; what is not finite becomes text."""
        ends = {"value": self.value, "low": self.low, "high": self.high}
        plain: dict[str, object] = {k: plain_number(v) for k, v in ends.items() if v is not None}
        return plain | ({"at_least": True} if self.at_least else {})


Cell = str | int | float | Measure | None


@dataclass(frozen=True)
class Row:
    """A row of a table.

    Attributes:
        cells: As many as the table has headers.
        ids: Models, evaluations or data sets that its numbers were read from.
    """

    cells: Sequence[Cell]
    ids: Sequence[str] = ()


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        name: Unique in the page; its numbers are kept under it.
        caption: What it shows.
        headers: Column names with units.
        rows: The rows.
    """

    name: str
    caption: str
    headers: Sequence[str]
    rows: Sequence[Row]


@dataclass(frozen=True)
class Illustration:
    """A figure.

    Attributes:
        name: Stem of its files, unique in the page.
        figure: What is drawn.
        caption: What is seen, and how to read it.
    """

    name: str
    figure: Figure
    caption: str


@dataclass(frozen=True)
class Missing:
    """Something that the study has not made, in a sentence."""

    text: str


@dataclass(frozen=True)
class Paragraph:
    """Text."""

    text: str


Block = Table | Illustration | Missing | Paragraph


@dataclass(frozen=True)
class Chapter:
    """A headed part of the page."""

    title: str
    blocks: Sequence[Block] = field(default_factory=list)


def plain_number(value: float) -> float | str:
    """A number for JSON, which knows neither NaN nor infinity."""
    return float(value) if isfinite(value) else str(float(value))
