"""How far another machine's clock is off, as far as a question and its answer can tell."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Offset:
    """How far another clock is ahead of ours: somewhere between two bounds.

    Attributes:
        low: Least (s); negative where it is behind.
        high: Most (s).
    """

    low: float
    high: float

    @classmethod
    def told(cls, sent: float, there: float, heard: float) -> "Offset":
        """From one exchange: the other clock was read some time between ours.

        Args:
            sent: Our clock when the question was sent (s).
            there: The other clock when it was read.
            heard: Our clock when the answer had come.
        """
        return cls(there - heard, there - sent)

    def __add__(self, other: "Offset") -> "Offset":
        """Of a third clock: ``other`` is its offset from the clock that this is the offset of."""
        return Offset(self.low + other.low, self.high + other.high)

    def narrowed(self, other: "Offset") -> "Offset":
        """What two exchanges tell together; the later one where a clock was set between them."""
        low, high = max(self.low, other.low), min(self.high, other.high)
        return Offset(low, high) if low <= high else other

    @property
    def middle(self) -> float:
        """Best guess (s)."""
        return (self.low + self.high) / 2.0

    @property
    def surely(self) -> float:
        """It is off by so much at least (s), whatever the exchange took."""
        return max(self.low, -self.high, 0.0)

    def __str__(self) -> str:
        doubt = f" (±{(self.high - self.low) / 2.0:.2g} s)"
        if not self.surely:
            return f"the same{doubt}"
        return f"{abs(self.middle):.1f} s {'ahead' if self.middle > 0 else 'behind'}{doubt}"
