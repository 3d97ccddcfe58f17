"""A process that solves tasks with the expert of whatever checkout ``PYTHONPATH`` names.

Run as a script it reads pickled requests from its input and writes pickled replies to its output.
Only plain values and arrays pass between the processes, and only what any checkout has is imported,
so that an older expert can be timed by a newer benchmark. A request is a task and noise as
dictionaries of arrays; the first reply tells how the expert was set up.
"""

import json
import os
import pickle
import signal
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import casadi

import lmtr
from lmtr.errors import ConfigurationError
from lmtr.expert.solve import Expert
from lmtr.task.sampling import Noise
from lmtr.task.task import Task
from pipelines.config import Configuration, as_toml, load

Reply = dict[str, Any]

ROBOT_FIGURE = "dataset.robot."
"""Start of the overrides that change a figure of a robot that may have been given by its name."""


def configuration(source: str | None, overrides: Sequence[str]) -> Configuration:
    """The configuration of a run, with overrides of single figures of a named robot too.

    Args:
        source: Built-in name, path of a TOML file, or None for the defaults.
        overrides: ``section.key=value``, as ``lmtr --set`` takes them.

    Raises:
        ConfigurationError: A setting is unknown or wrong.
    """
    of_robot = [text for text in overrides if text.strip().startswith(ROBOT_FIGURE)]
    config = load(source, [text for text in overrides if text not in of_robot])
    if not of_robot:
        return config
    with tempfile.TemporaryDirectory() as folder:
        spelt_out = Path(folder) / "configuration.toml"
        spelt_out.write_text(as_toml(config), encoding="utf-8")
        return load(str(spelt_out), of_robot)


def require_code_of(checkout: Path) -> None:
    """Refuse to measure the code of one place as that of another.

    Raises:
        ConfigurationError: The package comes from elsewhere.
    """
    found = Path(lmtr.__file__).resolve().parent.parent
    if found != checkout:
        raise ConfigurationError(
            f"the code that solves must come from {checkout}, but was found in {found}; give the "
            "root folder of a checkout"
        )


def set_up(source: str | None, overrides: Sequence[str], cache: Path) -> tuple[Expert, Reply]:
    """The expert, and what its set-up took."""
    config = configuration(source, overrides)
    begin = time.perf_counter()
    expert = Expert(config.dataset.robot, config.expert, cache)
    seconds = time.perf_counter() - begin
    key = config.expert.cost_key
    return expert, {
        "casadi": casadi.CasadiMeta.version(),
        "cost_key": key(config.dataset.robot) if callable(key) else key,  # once without the robot
        "setup_s": seconds,
        "compiled": expert.compiled,
        **asdict(expert.build_report),
    }


def solve(expert: Expert, task: Mapping[str, Any], noise: Mapping[str, Any]) -> Reply:
    """Solve one task; the processor time is that of the whole call, in all threads."""
    asked, guess = Task(**_known(Task, task)), Noise(**_known(Noise, noise))
    begin = time.process_time()
    solution = expert.solve(asked, guess)
    cpu_s = time.process_time() - begin
    trajectory = solution.trajectory
    return {
        "cpu_s": cpu_s,
        "solver_cpu_s": solution.solve_cpu_s,
        "status": str(solution.status),
        "iterations": solution.iterations,
        "cost": solution.cost,
        "liftoff_swaps": solution.liftoff_swaps,
        "window_active": solution.window_active,
        "saturated": getattr(solution, "saturated", ()),  # experts did not always tell
        "constraint_violation": max(solution.constraint_violation.values()),
        "trajectory": {f.name: getattr(trajectory, f.name) for f in fields(trajectory)},
    }


def _known(kind: type[Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The values that this checkout's ``kind`` has a field for."""
    return {f.name: values[f.name] for f in fields(kind) if f.name in values}


def main() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the benchmark ends its workers itself
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the solver prints must not get between the replies

    def reply(content: Reply) -> None:
        pickle.dump(content, replies)
        replies.flush()

    choice = json.loads(sys.argv[1])
    try:
        require_code_of(Path(choice["checkout"]))
        expert, report = set_up(choice["source"], choice["overrides"], Path(choice["cache"]))
        reply(report)
        while True:
            try:
                request = pickle.load(sys.stdin.buffer)
            except EOFError:
                return
            reply(solve(expert, **request))
    except Exception as error:  # whatever it is, the benchmark names it and stops
        reply({"error": f"{type(error).__name__}: {' '.join(str(error).split())}"})


if __name__ == "__main__":
    main()
