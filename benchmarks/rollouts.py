"""Time of 100 rollouts × 100 cycles of each replanner, and where it goes.

Run: ``python -m benchmarks.rollouts``. Data as in :mod:`benchmarks.planner`: 25,000 rows cut from
the expert's initial guesses, and networks of the paper's layers, briefly trained. Guesses are not
walks, so that limits are wide and every rollout lasts to its end. One process, one thread. Times
are medians of ``--rounds`` runs in which replanners take turns.
"""

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from time import process_time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.planner import WEIGHTS, library_and_queries
from lmtr.models.data import TrainingData
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from lmtr.models.training import train
from lmtr.policies.nearest_neighbour import TaskIndex
from lmtr.replanners.build import build_replanner
from lmtr.replanners.plan_cost import PlanCost
from lmtr.replanners.replanner import Replanner
from lmtr.replanners.selecting import Selection
from lmtr.robot.model import ANYMAL
from lmtr.rollout import testbed
from lmtr.rollout.accumulate import Accumulator
from lmtr.rollout.courses import random_courses
from lmtr.rollout.plausibility import judged
from lmtr.rollout.record import Ending
from lmtr.rollout.settings import PlausibleRange, RolloutSettings
from lmtr.rollout.starts import draw_starts
from lmtr.rollout.window import begin
from lmtr.vectors.segment_vector import decode_segment

PARTS: tuple[tuple[str, Any, str], ...] = (
    ("look-up", TaskIndex, "query"),
    ("decoder", TrainedModel, "predict"),
    ("plan cost", PlanCost, "of"),
    ("task", testbed, "encode_task"),
    ("decode τ", testbed, "decode_segment"),
    ("window", testbed, "carry_out"),
    ("judge", testbed, "judged"),
    ("record", Accumulator, "add"),
)
"""What is timed: none of them calls another one."""


@contextmanager
def timed_parts() -> Iterator[dict[str, float]]:
    """CPU seconds by part of everything that runs inside."""
    seconds: dict[str, float] = defaultdict(float)

    def timed(name: str, inner: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(inner)
        def outer(*args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
            begun = process_time()
            try:
                return inner(*args, **kwargs)
            finally:
                seconds[name] += process_time() - begun

        return outer

    kept = [(owner, attribute, getattr(owner, attribute)) for _, owner, attribute in PARTS]
    try:
        for (name, owner, attribute), (_, _, inner) in zip(PARTS, kept, strict=True):
            setattr(owner, attribute, timed(name, inner))
        yield seconds
    finally:
        for owner, attribute, inner in kept:
            setattr(owner, attribute, inner)


def walking(latent: int, data: TrainingData) -> TrainedModel:
    """A model that walks: 8 epochs are enough to go somewhere."""
    settings = TrainingSettings(epochs=8, patience=None, device="cpu")
    few = TrainingData(data.x[:1000], data.tau[:1000])
    return train(ModelSettings(latent=latent), settings, data, few, ANYMAL)


def replanners(data: TrainingData) -> list[Replanner]:
    unimodal, lmtr = (walking(n, data) for n in (0, 6))
    selections = [Selection(candidates=k) for k in (16, 64)]
    return [
        build_replanner(unimodal, data, WEIGHTS),
        build_replanner(lmtr, data, WEIGHTS),
        *(build_replanner(lmtr, data, WEIGHTS, selection=each) for each in selections),
        build_replanner(None, data, WEIGHTS),
        build_replanner(None, data, WEIGHTS, selection=selections[0], robot=ANYMAL),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rollouts", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    data, _ = library_and_queries()
    settings = RolloutSettings(
        plausible=PlausibleRange(height=(0.01, 9.0), tilt=9.0, foot_offset=9.0)
    )
    courses = random_courses(settings, 0, range(options.rollouts))
    endings = judged(begin(decode_segment(data.tau))[0], settings.plausible, ANYMAL)
    possible = np.array([ending is Ending.COMPLETED for ending in endings])
    starts = draw_starts(data.tau[possible], courses)
    tested = replanners(data)
    found: dict[str, list[tuple[float, dict[str, float], int]]] = defaultdict(list)
    for _ in range(options.rounds):
        for replanner in tested:
            with timed_parts() as parts:
                begun = process_time()
                rollouts = testbed.run_rollouts(replanner, courses, starts, settings, ANYMAL)
                cycles = sum(len(rollout.plan_seconds) for rollout in rollouts)
                found[replanner.name].append((process_time() - begun, dict(parts), cycles))
    names = [name for name, _, _ in PARTS]
    print(f"{options.rollouts} rollouts × {settings.n_cycles} cycles; CPU s, and shares in %")
    print(
        f"{'':20}{'s':>7}{'cycles':>8}" + "".join(f"{name:>11}" for name in names) + "      other"
    )
    for name, runs in found.items():
        total = float(np.median([run[0] for run in runs]))
        whole = sum(run[0] for run in runs)
        shares = [100 * sum(run[1].get(part, 0.0) for run in runs) / whole for part in names]
        cells = "".join(f"{share:11.0f}" for share in [*shares, 100 - sum(shares)])
        print(f"{name:20}{total:7.2f}{runs[0][2]:8d}{cells}")


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
