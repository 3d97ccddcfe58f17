"""A sweep on Ray Tune, which places trials, restarts those whose worker died, and reports.

Of Tune's own files, tables and messages the user sees none: results travel through an actor beside
the driver, not through files, so that hosts need no common disk.
"""

import logging
import os
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import ray
from ray import tune
from ray.actor import ActorHandle
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from services.cluster.sweep import Done, Seldom, Sweep, Trial, gpu_share
from services.cluster.sweep_listener import RETRIES, Ender, Listener
from services.cluster.worker import attempted, described
from services.errors import ClusterError

TUNE_ENVIRONMENT = {
    "TUNE_DISABLE_SIGINT_HANDLER": "1",  # signals are the driver's
    "TUNE_DISABLE_AUTO_CALLBACK_LOGGERS": "1",  # no CSV, JSON and TensorBoard files
    "TUNE_GLOBAL_CHECKPOINT_S": "3600",  # the lake knows what is done
    "TUNE_WARN_EXCESSIVE_EXPERIMENT_CHECKPOINT_SYNC_THRESHOLD_S": "0",
    "RAY_CHDIR_TO_TRIAL_DIR": "0",
    "RAY_AIR_NEW_OUTPUT": "0",
}
"""How Tune is told, where alone it reads it, to keep to itself."""

NOISY = ("ray.tune", "ray.train", "ray.air")


class Outbox:
    """The actor: holds what trials made until the driver takes it."""

    def __init__(self) -> None:
        self._done: dict[int, Done[Any]] = {}

    def put(self, number: int, done: Done[Any]) -> None:
        """Take in what came of a trial."""
        self._done[number] = done

    def take(self, number: int) -> Done[Any] | None:
        """Hand it out, once."""
        return self._done.pop(number, None)


def run_sweep(sweep: Sweep[Any, Any, Any], slots: int) -> None:
    """Train all trials, ``slots`` at once; see :meth:`Cluster.sweep`."""
    share = gpu_share(sweep.device, ray.cluster_resources().get("GPU", 0.0), slots)
    if not sweep.trials:
        return
    outbox = _outbox()
    listener = Listener(sweep, outbox)
    try:
        with _quiet(), tempfile.TemporaryDirectory(prefix="lmtr-sweep-") as scratch:
            _tuner(sweep, outbox, listener, slots, share, scratch).fit()
    except Exception as error:
        raise ClusterError(
            f"cluster: the sweep cannot go on: {described(error)}; run the same command to go on"
        ) from error
    finally:
        ray.kill(outbox)
    listener.settle()


def _tuner(
    sweep: Sweep[Any, Any, Any],
    outbox: ActorHandle,
    listener: Listener,
    slots: int,
    share: float,
    scratch: str,
) -> tune.Tuner:
    shared = (sweep.trainable, sweep.data, list(sweep.trials))
    return tune.Tuner(
        tune.with_resources(
            tune.with_parameters(_run_trial, shared=shared, outbox=outbox),
            {"cpu": 1, "gpu": share},
        ),
        param_space={"number": tune.grid_search(list(range(len(sweep.trials))))},
        tune_config=tune.TuneConfig(max_concurrent_trials=slots, reuse_actors=True),
        run_config=tune.RunConfig(
            name="sweep",
            storage_path=scratch,
            verbose=0,
            callbacks=[listener],
            stop=Ender(listener.ending),
            failure_config=tune.FailureConfig(max_failures=RETRIES),
        ),
    )


def _run_trial(
    config: Mapping[str, int],
    shared: tuple[Any, object, Sequence[Trial[Any]]],
    outbox: ActorHandle,
) -> None:
    """What runs in a worker process."""
    trainable, data, trials = shared
    number = config["number"]
    report = Seldom(lambda metrics: tune.report(dict(metrics)))
    done = attempted(trainable, trials[number].config, data, report)
    try:
        sent = outbox.put.remote(number, done)
    except Exception as error:  # whatever pickle refuses with
        lost: Done[Any] = Done(error=f"its result cannot be sent back: {described(error)}")
        sent = outbox.put.remote(number, lost)
    ray.get(sent)
    tune.report({"delivered": 1.0})  # waits until the driver has taken it


def _outbox() -> ActorHandle:
    here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=False)
    return ray.remote(Outbox).options(num_cpus=0, scheduling_strategy=here).remote()


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Tune's messages from the user; what ends a sweep is told as an error."""
    for name, value in TUNE_ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    loggers = [logging.getLogger(name) for name in NOISY]
    # Modules of Tune set levels of their own, so those below are kept silent as well.
    loggers += [
        logging.getLogger(name)
        for name in list(logging.root.manager.loggerDict)
        if name.startswith(tuple(f"{noisy}." for noisy in NOISY))
    ]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
