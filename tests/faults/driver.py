"""The command line as a process that faults befall, and the data set that must come of it."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import pyarrow as pa

from benchmarks.processes import Role, end_all, family, kill, playing
from services.errors import ServiceError
from services.home import Home
from services.lake.digest import digested_columns, row_digests
from services.lake.tables import Lake

COUNT = int(os.environ.get("LMTR_FAULTS_SOLUTIONS", "64"))
"""Solutions of a data set; more of them make the runs, and the time for faults, longer."""

PATIENCE_S = 240.0
"""No run may take longer, whatever befalls it."""

CONFIGURATION = f"""
[dataset]
name = "faults"
solutions = {COUNT}
seed = 11

[expert.scope]
duration = 2.5
n_swings = 2

[tasks]
goal_distance = [0.7, 0.9]
goal_lateral = 0.1
first_obstacle = [0.4, 0.5]
obstacle_count = [1, 1]

[cluster]
batch_seconds = 0.2
commit_items = 4
commit_seconds = 0.5
"""
"""Short walks, solved in a tenth of a second, and many small commits."""

SYNCHRONOUS = {"PYTHONUNBUFFERED": "1", "COLUMNS": "300"}


def arguments(*words: object) -> list[str]:
    """The command line with these words."""
    return [sys.executable, "-m", "pipelines", *map(str, words)]


def lmtr(*words: object) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(
        arguments(*words), capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


class Driver:
    """``lmtr generate`` as a process; whatever still runs of it ends with the block.

    Args:
        home: The home that it fills.
        config: Its configuration.
        options: Further words of the command.
        workers: So many workers.
        before: What the command is run by.
        environment: Variables that it has besides.
        command: Another program that generates, in the place of all words.

    Attributes:
        pid: Number of its process.
        home: The home that it fills.
    """

    def __init__(
        self,
        home: Path,
        config: Path | None,
        *options: object,
        workers: int = 2,
        before: Sequence[str] = (),
        environment: Mapping[str, str] | None = None,
        command: Sequence[str] = (),
    ) -> None:
        words = ("--home", home, "generate", "-c", config, "--workers", workers)
        self.home = home
        self._seen: dict[int, psutil.Process] = {}
        self._process = subprocess.Popen(
            [*before, *(command or arguments(*words)), *map(str, options)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={**os.environ, **SYNCHRONOUS, **(environment or {})},
        )
        self.pid = self._process.pid

    def __enter__(self) -> "Driver":
        return self

    def __exit__(self, *_: object) -> None:
        end_all(self.members())
        with suppress(ProcessLookupError):
            self._process.kill()
        self._process.communicate()

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self._process.poll() is None

    def members(self) -> list[psutil.Process]:
        """Every process that was ever seen of this driver."""
        self._seen.update((process.pid, process) for process in family(self.pid))
        return list(self._seen.values())

    def await_rows(self, count: int) -> None:
        """Return when the lake holds so many rows."""
        until = time.monotonic() + PATIENCE_S
        while committed(self.home) < count:
            assert self.runs, f"the driver ended before {count} rows were there: {self.end()}"
            assert time.monotonic() < until, f"there were never {count} rows"
            self.members()
            time.sleep(0.02)

    def kill(self, role: Role) -> None:
        """SIGKILL every process of this role, as soon as there is one.

        Of one alone it could not be told whether it had work: it may be starting.
        """
        until = time.monotonic() + 30.0
        while self.runs and time.monotonic() < until:
            self.members()
            killed = [kill(process) for process in playing(role, self.pid)]
            if any(killed):
                return
            time.sleep(0.02)
        raise AssertionError(f"no {role} to kill")

    def signal(self, number: signal.Signals) -> None:
        """Send the driver alone a signal."""
        self.members()
        self._process.send_signal(number)

    def end(self) -> tuple[int, str]:
        """Wait for the end: exit status and standard error."""
        until = time.monotonic() + PATIENCE_S
        _, said = self._process.communicate(timeout=max(0.1, until - time.monotonic()))
        return self._process.returncode, said


def finish(home: Path, config: Path, *options: object) -> None:
    """Repeat the command until its end, without a fault."""
    with Driver(home, config, *options) as driver:
        status, said = driver.end()
    assert status == 0, said


def committed(home: Path) -> int:
    """How many rows the lake holds."""
    if not (home / "lake" / "solutions" / "_delta_log").is_dir():
        return 0
    with suppress(ServiceError, OSError):
        return len(_lake(home).values("solutions", "index"))
    return 0


def rows(home: Path) -> pa.Table:
    """Identity, numbers and digests of all rows, by index."""
    columns = [*digested_columns("solutions"), "digest"]
    return _lake(home).read("solutions", columns, order_by='"index"').combine_chunks()


def history(home: Path) -> list[dict[str, Any]]:
    """The commits of the solutions' table, newest first."""
    return _lake(home).history("solutions")


def mended(home: Path) -> Counter[str]:
    """What the last run says in the table's history that went wrong and was mended."""
    noted = [entry["lmtr.mended"] for entry in history(home) if "lmtr.mended" in entry]
    return Counter(json.loads(noted[0]))


def require_equal(made: pa.Table, reference: pa.Table) -> None:
    """Every row once, with the same numbers to the last bit, and a digest that fits them."""
    indices = made["index"].to_pylist()
    lost = sorted(set(reference["index"].to_pylist()) - set(indices))
    doubled = sorted({index for index in indices if indices.count(index) > 1})
    assert (lost, doubled) == ([], []), "rows lost and doubled"
    differing = [name for name in reference.column_names if not made[name].equals(reference[name])]
    assert differing == [], "columns that differ"
    assert made["digest"].to_pylist() == row_digests("solutions", made)


def require_complete(home: Path, reference: pa.Table) -> None:
    """The home holds the reference data set, and its lake is whole."""
    require_equal(rows(home), reference)
    checked = lmtr("--home", home, "lake", "check")
    assert checked.returncode == 0, checked.stdout + checked.stderr


def require_one_line(said: str, *words: str) -> None:
    """The last line of what was said is the error, names these, and no traceback came with it."""
    last = said.strip().splitlines()[-1] if said.strip() else ""
    assert last.startswith("lmtr: "), said
    assert all(word in last for word in words), last
    assert "Traceback" not in said, said


def _lake(home: Path) -> Lake:
    return Lake(Home.open(home, create=False).lake)
