"""Findings, and how they are shown: one line each, with what to do about it."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from rich.console import Console
from rich.table import Table
from rich.text import Text

from pipelines.terminal import printable_text


class Grade(StrEnum):
    """How bad a finding is."""

    GOOD = "good"
    WARNING = "warning"
    FAULT = "fault"


MARKS = {Grade.GOOD: "✓", Grade.WARNING: "!", Grade.FAULT: "✗"}


@dataclass(frozen=True)
class Finding:
    """One thing looked at.

    Attributes:
        subject: What was looked at.
        state: What was found.
        mend: What to do about it; empty where all is well.
        fatal: Whether work fails without it.
    """

    subject: str
    state: str
    mend: str = ""
    fatal: bool = False

    @classmethod
    def of(cls, subject: str, error: Exception, *, fatal: bool = True) -> "Finding":
        """What an error of ours says: cause, then mend."""
        cause, _, mend = " ".join(str(error).split()).partition("; ")
        return cls(subject, cause, mend or "mend this first", fatal)

    @property
    def grade(self) -> Grade:
        """How bad it is."""
        if self.fatal:
            return Grade.FAULT
        return Grade.WARNING if self.mend else Grade.GOOD


def healthy(findings: Sequence[Finding]) -> bool:
    """Whether nothing fatal was found."""
    return not any(finding.fatal for finding in findings)


def show(title: str, findings: Sequence[Finding], *, form_json: bool = False) -> None:
    """Print findings as a table, or as JSON for programs."""
    if form_json:
        plain = [
            {
                "what": finding.subject,
                "grade": finding.grade,
                "state": finding.state,
                "mend": finding.mend,
            }
            for finding in findings
        ]
        print(json.dumps({"healthy": healthy(findings), "findings": plain}, indent=2))
        return
    table = Table(title=Text(title), header_style="bold")
    for column in ("", "what", "state", "what to do"):
        table.add_column(column, overflow="fold")
    for finding in findings:
        table.add_row(
            MARKS[finding.grade],
            *map(printable_text, (finding.subject, finding.state, finding.mend)),
        )
    Console().print(table)
