"""Layouts: the one place that knows where each quantity lies in a packed vector.

A layout is a contract between data, models and exports. It travels with them as metadata, and
nothing outside it indexes a packed vector by number.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from math import prod
from typing import Any, Self

import numpy as np

from lmtr.arrays import Array, Indices
from lmtr.errors import DataError
from lmtr.robot.model import FEET
from lmtr.trajectory.trajectory import BASE_STEP, FORCE_PIECES

N_LINES = 2
"""Obstacle lines in the task: the next two (Sec. 5.1)."""

SEGMENT_DURATION = 0.8
"""T of the segment's scope (s)."""

SEGMENT_NODES = round(SEGMENT_DURATION / BASE_STEP) + 1
"""Base nodes of a segment, one at each end."""

SEGMENT_STANCES = 2
"""Stances per foot of a segment, with one swing between them."""


@dataclass(frozen=True)
class Field:
    """One quantity of a packed vector.

    Attributes:
        name: Unique within its layout.
        shape: Shape of the quantity; () is a single number.
        unit: SI unit; where it changes along the last axes, the units in order.
        frame: Frame of its coordinates, such as ``S``; empty where none applies.
        category: Group that weights and summaries address together.
        meaning: One sentence. It may be reworded without making another layout.
    """

    name: str
    shape: tuple[int, ...]
    unit: str
    frame: str
    category: str
    meaning: str = field(compare=False)

    @property
    def size(self) -> int:
        """How many numbers the quantity takes."""
        return prod(self.shape)


@dataclass(frozen=True)
class Layout:
    """Fields packed one after the other, each flattened in C order.

    Two layouts are equal if name, version and all fields but for their prose agree.
    """

    name: str
    version: int
    fields: tuple[Field, ...]

    def __post_init__(self) -> None:
        names = [f.name for f in self.fields]
        doubled = sorted({name for name in names if names.count(name) > 1})
        if doubled:
            raise DataError(f"layout {self}: field names must be unique, got {doubled} repeatedly")

    def __str__(self) -> str:
        return f"{self.name!r} version {self.version} (size {self.size})"

    @cached_property
    def size(self) -> int:
        """Length of the packed vector."""
        return sum(f.size for f in self.fields)

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where each field lies, by name, in packing order."""
        ends = np.cumsum([f.size for f in self.fields]).tolist()
        return {f.name: slice(end - f.size, end) for f, end in zip(self.fields, ends, strict=True)}

    def slice(self, name: str) -> slice:
        """Where the field ``name`` lies."""
        if name not in self.slices:
            raise DataError(f"layout {self}: no field {name!r}; it has {', '.join(self.slices)}")
        return self.slices[name]

    @cached_property
    def categories(self) -> tuple[str, ...]:
        """Categories in the order in which they first appear."""
        return tuple(dict.fromkeys(f.category for f in self.fields))

    def category_indices(self) -> dict[str, Indices]:
        """Indices of each category's numbers, ascending; a category need not be contiguous."""
        owner = np.repeat([f.category for f in self.fields], [f.size for f in self.fields])
        return {category: np.flatnonzero(owner == category) for category in self.categories}

    def field_at(self, index: int) -> Field:
        """The field that owns the number at ``index``."""
        return next(f for f in self.fields if index < self.slices[f.name].stop)

    def pack(self, parts: Mapping[str, Array]) -> Array:
        """Pack one array (..., *shape) per field into vectors (..., size).

        Leading batch axes are broadcast against each other.

        Raises:
            DataError: A field is missing, unknown or of another shape.
        """
        if parts.keys() != self.slices.keys():
            missing, unknown = self.slices.keys() - parts.keys(), parts.keys() - self.slices.keys()
            raise DataError(
                f"layout {self}: pack needs each field once; missing {sorted(missing)}, "
                f"unknown {sorted(unknown)}"
            )
        arrays = {f.name: self._require_shape(f, np.asarray(parts[f.name])) for f in self.fields}
        batch = np.broadcast_shapes(
            *(arrays[f.name].shape[: arrays[f.name].ndim - len(f.shape)] for f in self.fields)
        )
        packed = np.empty((*batch, self.size))
        for f in self.fields:
            array = arrays[f.name]
            lead = array.shape[: array.ndim - len(f.shape)]
            packed[..., self.slices[f.name]] = array.reshape((*lead, f.size))
        return packed

    def unpack(self, vectors: Array) -> dict[str, Array]:
        """The fields (..., *shape) of vectors (..., size), as views where possible."""
        vectors = self.require_size(vectors)
        batch = vectors.shape[:-1]
        return {
            f.name: vectors[..., self.slices[f.name]].reshape((*batch, *f.shape))
            for f in self.fields
        }

    def require_size(self, vectors: Array) -> Array:
        """The vectors, refused unless their last axis is this layout's size.

        Raises:
            DataError: Another length.
        """
        vectors = np.asarray(vectors)
        if vectors.ndim == 0 or vectors.shape[-1] != self.size:
            raise DataError(
                f"layout {self}: vectors must have a last axis of {self.size}, got shape "
                f"{vectors.shape}; they belong to another layout"
            )
        return vectors

    def require_finite(self, vectors: Array) -> Array:
        """The vectors, refused if they hold NaN or infinity.

        Raises:
            DataError: Naming the first field concerned.
        """
        vectors = self.require_size(vectors)
        if not np.isfinite(vectors).all():
            bad = ~np.isfinite(vectors.reshape(-1, self.size))
            culprit = self.field_at(int(np.flatnonzero(bad.any(axis=0))[0]))
            raise DataError(
                f"layout {self}: vectors must be finite, got NaN or infinity in field "
                f"{culprit.name!r} ({bad.any(axis=1).sum()} of {len(bad)} rows affected); "
                "leave these rows out or make them again"
            )
        return vectors

    def require_equal(self, other: "Layout") -> None:
        """Refuse data or a model of another layout.

        Raises:
            DataError: Naming both layouts and the first field in which they differ.
        """
        if self == other:
            return
        pairs = zip(self.fields, other.fields, strict=False)
        differing = [f"{mine.name!r}/{theirs.name!r}" for mine, theirs in pairs if mine != theirs]
        where = f", first differing in field {differing[0]}" if differing else ""
        raise DataError(
            f"layout {self} is required, got layout {other}{where}; "
            "use data and models made with the same layout"
        )

    def metadata(self) -> dict[str, Any]:
        """The layout as plain JSON types, stored with every data set and model."""
        fields = [{**asdict(f), "shape": list(f.shape)} for f in self.fields]
        return {"name": self.name, "version": self.version, "size": self.size, "fields": fields}

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, Any]) -> Self:
        """The layout that :meth:`metadata` described.

        Raises:
            DataError: The description is incomplete or contradicts itself.
        """
        try:
            fields = tuple(Field(**{**f, "shape": tuple(f["shape"])}) for f in metadata["fields"])
            layout = cls(str(metadata["name"]), int(metadata["version"]), fields)
            size = metadata["size"]
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(
                f"layout metadata must hold name, version, size and fields, got {error!r} while "
                "reading it; the file was not written by this package"
            ) from error
        if layout.size != size:
            raise DataError(
                f"layout {layout}: metadata state a size of {size}; they were edited or damaged"
            )
        return layout

    def _require_shape(self, f: Field, array: Array) -> Array:
        if array.shape[array.ndim - len(f.shape) :] != f.shape or array.ndim < len(f.shape):
            raise DataError(
                f"layout {self}: field {f.name!r} must have trailing shape {f.shape}, "
                f"got {array.shape}"
            )
        return array


TASK_LAYOUT = Layout(
    "task",
    1,
    (
        Field("height", (), "m", "S", "chi_base", "Height of the base."),
        Field("roll_pitch", (2,), "rad", "S", "chi_base", "Roll and pitch of the base."),
        Field("linear_velocity", (3,), "m/s", "S", "chi_base", "Velocity of the base."),
        Field("angular_velocity", (3,), "rad/s", "S", "chi_base", "Angular velocity of the base."),
        *(
            field
            for foot in FEET
            for field in (
                Field(f"{foot}_position", (3,), "m", "S", "chi_feet", f"Position of {foot}."),
                Field(
                    f"{foot}_time_since_liftoff",
                    (),
                    "s",
                    "",
                    "chi_feet",
                    f"How long {foot} has been swinging; 0 in stance.",
                ),
            )
        ),
        Field(
            "next_lines",
            (N_LINES, 3),
            "m, m, rad",
            "S",
            "eta",
            "The next obstacle lines: point nearest to the origin, direction in [0, π).",
        ),
        Field("goal_position", (2,), "m", "S", "gamma", "x, y of the goal pose."),
        Field("goal_heading", (2,), "1", "S", "gamma", "cos ψ, sin ψ of the goal pose's yaw."),
    ),
)
"""Layout of x."""


def _foot_fields(foot: str) -> tuple[Field, ...]:
    return (
        Field(
            f"{foot}_times",
            (2 * SEGMENT_STANCES,),
            "s",
            "",
            "times",
            f"{foot}: start of the first stance, lift-off, touch-down, end of the second stance.",
        ),
        Field(f"{foot}_first_foothold", (3,), "m", "S", "motion", f"{foot}: first foothold."),
        Field(f"{foot}_swing_position", (3,), "m", "S", "motion", f"{foot}: mid-swing position."),
        Field(
            f"{foot}_swing_velocity",
            (2,),
            "m/s",
            "S",
            "motion",
            f"{foot}: horizontal velocity in mid-swing.",
        ),
        Field(f"{foot}_second_foothold", (3,), "m", "S", "motion", f"{foot}: second foothold."),
        Field(
            f"{foot}_forces",
            (SEGMENT_STANCES, FORCE_PIECES, 2, 3),
            "N; N/s",
            "S",
            "forces",
            f"{foot}: by stance, its free force nodes: value and time derivative.",
        ),
    )


SEGMENT_LAYOUT = Layout(
    "segment",
    1,
    (
        Field(
            "base_nodes",
            (SEGMENT_NODES, 2, 6),
            "m, rad; m/s, rad/s",
            "S",
            "base",
            "Every 0.1 s from the epoch: position and roll, pitch, yaw; their time derivatives.",
        ),
        *(field for foot in FEET for field in _foot_fields(foot)),
    ),
)
"""Layout of τ: forces are in the axes of _S, z up."""
