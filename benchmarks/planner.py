"""Time and memory of one plan for each replanner (Sec. 4.3 has about 3 ms, and 60 and 10 MB).

Run: ``python benchmarks/planner.py``. The library has the paper's 25,000 rows, cut from the
expert's initial guesses; the networks have the paper's layers. One thread. What a network has
learnt does not change its time, so one epoch will do.
"""

from collections.abc import Callable, Iterator
from time import perf_counter

import numpy as np
from threadpoolctl import threadpool_limits

from lmtr.expert.initial_guess import initial_guess
from lmtr.expert.settings import Scope
from lmtr.models.data import TrainingData
from lmtr.models.settings import ModelSettings, TrainingSettings
from lmtr.models.trained import TrainedModel
from lmtr.models.training import train
from lmtr.policies.distance import TaskWeights
from lmtr.policies.nearest_neighbour import TaskIndex
from lmtr.replanners.build import build_replanner
from lmtr.robot.model import ANYMAL
from lmtr.segmentation.segment import SegmentationSettings, segment_solution
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise, sample_task

ROWS = 25_000
CALLS = 2_000
WEIGHTS = TaskWeights.of([1.0, 1.0, 5.0, 0.5])


def segments() -> Iterator[tuple[np.ndarray, np.ndarray]]:
    distribution, scope, settings = TaskDistribution(), Scope(), SegmentationSettings()
    index = 0
    while True:
        rng = stream(0, Purpose.TASK, index)
        task = sample_task(distribution, ANYMAL, rng)
        noise = sample_noise(distribution, scope.n_swings, rng)
        walk = initial_guess(task, noise, ANYMAL, scope).trajectory
        cut = segment_solution(walk, task.obstacles_W, settings, rng)
        yield cut.x, cut.tau
        index += 1


def library_and_queries() -> tuple[TrainingData, np.ndarray]:
    xs, taus, count = [], [], 0
    for x, tau in segments():
        xs.append(x)
        taus.append(tau)
        count += len(x)
        if count >= ROWS + CALLS:
            break
    x, tau = np.concatenate(xs), np.concatenate(taus)
    return TrainingData(x[:ROWS], tau[:ROWS]), x[ROWS : ROWS + CALLS]


def briefly_trained(latent: int, data: TrainingData) -> TrainedModel:
    settings = TrainingSettings(epochs=1, validate_every=1, patience=None, device="cpu")
    few = TrainingData(data.x[:1000], data.tau[:1000])
    return train(ModelSettings(latent=latent), settings, data, few, ANYMAL)


def microseconds(plan: Callable[[np.ndarray], object], x: np.ndarray, batch: int) -> np.ndarray:
    """Time of each call with ``batch`` tasks, per task."""
    calls = len(x) // batch
    taken = np.empty(calls)
    for call in range(-min(20, calls), calls):  # the first few only warm up
        tasks = x[(call % calls) * batch : (call % calls + 1) * batch]
        start = perf_counter()
        plan(tasks)
        if call >= 0:
            taken[call] = perf_counter() - start
    return 1e6 * taken / batch


def main() -> None:
    data, x = library_and_queries()
    unimodal, lmtr = (briefly_trained(n, data) for n in (0, 6))
    index = TaskIndex(data.x, WEIGHTS, lmtr.task_scaling)
    decoder = lambda tasks: lmtr.predict(tasks, np.zeros((len(tasks), 6)))  # noqa: E731 - a row
    replanners = [build_replanner(model, data, WEIGHTS) for model in (unimodal, lmtr, None)]
    rows: list[tuple[str, Callable[[np.ndarray], object], int]] = [
        ("look-up alone", index.query, index.nbytes),
        ("decoder alone", decoder, lmtr.nbytes),
        *((r.name, r.plan, r.nbytes) for r in replanners),
    ]
    reference = float(np.median(microseconds(replanners[-1].plan, x, 1)))
    print(f"{ROWS} library rows, one thread; µs per plan")
    print(f"{'':16}{'median':>9}{'p99':>9}{'of library':>12}{'in 100s':>9}{'MB':>8}")
    for name, plan, nbytes in rows:
        single, hundreds = microseconds(plan, x, 1), microseconds(plan, x, 100)
        median = float(np.median(single))
        print(
            f"{name:16}{median:9.0f}{np.percentile(single, 99):9.0f}{median / reference:12.2f}"
            f"{np.median(hundreds):9.0f}{nbytes / 1e6:8.1f}"
        )


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
