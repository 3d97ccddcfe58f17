"""What others wrote reaches a terminal as letters, and does nothing there."""

import io
import re

import pytest
from rich.console import Console

from pipelines.progress import say
from pipelines.remote import tables
from pipelines.remote.target import Target
from pipelines.remote.watch import LogView, show_log
from pipelines.terminal import printable, printable_text
from services.cluster.head import Head
from services.cluster.jobs import Job, Jobs, JobStatus

ATTACKS = [
    "\x1b]0;title\x07",
    "\x1b]52;c;cm0gLXJm\x1b\\",
    "\x1b]8;;file:///etc/passwd\x07link\x1b]8;;\x07",
    "\x1b[2J\x1b[1;1H",
    "\x1b[8mhidden\x1b[0m",
    "\x1bPq#0;2;0;0;0\x1b\\",
    "\x1bc",
    "\x9b2J",
    "\x9d0;title\x9c",
    "all is well\rnot so",
    "\x1b",
    "\x1b]0;never ends",
    "\x08\x08\x7f\x00",
    "\u202egnp.exe\u2066",
]
UNSAFE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


class Cluster(Jobs):
    """A cluster whose only job says what it is told to say everywhere."""

    def __init__(self, said):
        super().__init__(Head("http://127.0.0.1:1"))
        self._said = said

    def ray_version(self):
        return self._said

    def list(self):
        noted = dict.fromkeys(("lmtr.stage", "lmtr.configuration", "lmtr.dataset"), self._said)
        return [Job(submission_id=self._said, status=JobStatus.RUNNING, metadata=noted)]

    def log(self, job_id):
        return f"before\n{self._said}\nSolving: 1/2 {self._said}"


@pytest.mark.parametrize("attack", ATTACKS)
def test_no_control_sequence_is_left(attack):
    shown = printable(f"a{attack}\tb\tc\n")
    assert not UNSAFE.search(shown)
    assert shown.startswith("a")
    assert shown.endswith("b\tc\n")


def test_other_text_stays_as_it_is():
    for text in ("τ̄ ∈ R²⁶⁴ 👩‍🔬", "two\nlines\tof it", "[red]brackets[/]", ""):
        assert printable(text) == printable_text(text).plain == text
    assert printable("\x1b[36m(worker)\x1b[0m 5 done") == "(worker) 5 done"


@pytest.mark.parametrize("attack", [*ATTACKS, "[/nonsense]", "[link=file:///x]y[/link]"])
def test_a_clusters_words_do_nothing_to_a_terminal(attack, capsys, monkeypatch):
    target = Target(Cluster(f"x{attack}y"), None)
    monkeypatch.setattr(tables, "nodes", lambda head: [])
    tables.show_jobs(target)
    tables.show_status(target)
    show_log(target, "x")
    say(f"x{attack}y")
    out, err = capsys.readouterr()
    assert "before" in out
    assert not UNSAFE.search(out + err)


def test_a_followed_log_in_a_terminal_does_nothing_of_its_own():
    file = io.StringIO()
    with LogView(Console(file=file, force_terminal=True, width=80)) as view:
        view.line("\x1b]52;c;cm0gLXJm\x07said")
        view.line("Solving: 1/2 \x1b]0;title\x07")
    assert "said" in file.getvalue()
    assert "\x1b]" not in file.getvalue()
    assert "\x07" not in file.getvalue()
