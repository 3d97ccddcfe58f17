"""The interface of everything that plans."""

from typing import Any, Protocol

from lmtr.arrays import Array


class Replanner(Protocol):
    """What a rollout asks of a planner; a new one needs no more than this.

    Attributes:
        name: The paper's name, for tables and figures.
        nbytes: Memory that planning needs (bytes).
    """

    @property
    def name(self) -> str: ...  # noqa: D102 - the class docstring has both

    @property
    def nbytes(self) -> int: ...  # noqa: D102

    def plan(self, x: Array) -> Array:
        """Segments τ (B, 264) for tasks x (B, 35), SI units, _S.

        Each segment depends on its own task alone, and the same task gets the same segment.

        Raises:
            DataError: Tasks of another layout, or not finite.
        """
        ...

    def describe(self) -> dict[str, Any]:
        """Settings and origin as plain JSON types, for provenance."""
        ...
