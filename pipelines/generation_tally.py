"""What a generation counts: rate, accepted share, failures by kind, and what was mended."""

import json
import time
from collections import Counter, deque
from collections.abc import Mapping

from pipelines.provenance import code_version
from services.cluster.delivery import Note, Trouble
from services.lake.sink import Receipt

RATE_OVER_S = 60.0
"""Time over which the present rate is told (s)."""

RATE_STEP_S = 1.0
"""Time between two counts that are kept for it (s)."""


class GenerationTally:
    """Counts solutions as they are made and as they are kept."""

    def __init__(self, dataset_id: str) -> None:
        self._dataset_id = dataset_id
        self._began = time.monotonic()
        self._recent = deque([(self._began, 0)])
        self.solved = 0
        self.accepted = 0
        self.committed = 0
        self.doubled = 0
        self.solve_cpu_s = 0.0
        self.statuses: Counter[str] = Counter()
        self.reasons: Counter[str] = Counter()
        self.troubles: Counter[str] = Counter()

    def add(self, note: Note) -> int:
        """Count one solution."""
        self._count(note, 1)
        now = time.monotonic()
        if now - self._recent[-1][0] > RATE_STEP_S:
            self._recent.append((now, self.solved))
        while len(self._recent) > 2 and now - self._recent[0][0] > RATE_OVER_S:
            self._recent.popleft()
        return 1

    def trouble(self, trouble: Trouble) -> int:
        """Count what went wrong and was mended; what was lost is counted when it is made again."""
        self.troubles[trouble.kind] += 1
        for note in trouble.notes:
            self._count(note, -1)
        return len(trouble.notes)

    def kept(self, receipt: Receipt) -> None:
        """Take note of a commit."""
        self.committed += receipt.appended.rows
        self.doubled += receipt.appended.doubled

    def _count(self, note: Note, times: int) -> None:
        self.solved += times
        self.accepted += times * note["accepted"]
        self.solve_cpu_s += times * (note["solve_cpu_s"] or 0.0)
        self.statuses[note["status"]] += times
        for reason in note["reasons"]:
            self.reasons[reason] += times

    @property
    def rate(self) -> float:
        """Solutions per second of late."""
        (then, before), now = self._recent[0], time.monotonic()
        return (self.solved - before) / max(now - then, 1e-3)

    @property
    def accepted_share(self) -> float:
        """Share of the solutions that the filter accepts."""
        return self.accepted / self.solved if self.solved else 0.0

    def words(self) -> str:
        """Rate, accepted share and what went otherwise."""
        if not self.solved:
            return "nothing solved yet"
        others = {k: n for k, n in self.statuses.most_common() if k != "converged"}
        parts = [f"{self.rate:.1f}/s", f"{self.accepted_share:.0%} accepted"]
        parts += [f"{count} {kind}" for kind, count in (others | self.troubles).items()]
        return ", ".join(parts)

    def result(self) -> str:
        """What all of it came to, in one line."""
        seconds = time.monotonic() - self._began
        kinds = ", ".join(f"{count} {kind}" for kind, count in self.statuses.most_common())
        parts = [f"{self.solved} solved in {seconds:.0f} s ({kinds or 'none'})"]
        parts.append(f"{self.accepted_share:.0%} accepted")
        if self.doubled:
            parts.append(f"{self.doubled} of them in the table already, from another driver or try")
        parts += [f"mended: {count} {kind}" for kind, count in self.troubles.items()]
        return ", ".join(parts)

    def numbers(self) -> dict[str, float]:
        """All counts by name, for the tracker."""
        counts = {
            "solved": self.solved,
            "committed": self.committed,
            "doubled": self.doubled,
            "accepted_share": self.accepted_share,
            "rate_per_s": self.rate,
            "solve_cpu_s": self.solve_cpu_s,
            "seconds": time.monotonic() - self._began,
        }
        named = (
            ("status", self.statuses),
            ("rejected", self.reasons),
            ("mended", self.troubles),
        )
        return counts | {
            f"{group}.{kind}": count for group, kinds in named for kind, count in kinds.items()
        }

    def figures(self) -> Mapping[str, str]:
        """The same for the table's history."""
        return {
            "lmtr.dataset_id": self._dataset_id,
            "lmtr.code_version": code_version(),
            "lmtr.solved": str(self.solved),
            "lmtr.accepted_share": f"{self.accepted_share:.4f}",
            "lmtr.rate_per_s": f"{self.rate:.3f}",
            "lmtr.statuses": json.dumps(self.statuses),
            "lmtr.mended": json.dumps(self.troubles),
        }
