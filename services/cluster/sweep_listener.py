"""What Tune tells of trials, passed on to the owner of a sweep."""

from collections.abc import Callable, Mapping
from typing import Any

import ray
from ray.actor import ActorHandle
from ray.exceptions import RayError
from ray.tune import Callback, Stopper
from ray.tune.experiment import Trial as TuneTrial

from services.cluster.sweep import Done, Sweep
from services.cluster.worker import described
from services.errors import ClusterError

RETRIES = 3
"""How often a trial is begun again after its worker died."""


class Listener(Callback):  # type: ignore[misc]  # Ray is untyped here
    """Brings what trials say and made to the sweep's owner.

    Tune takes what a callback raises for the trial's own failure, so that is kept for the driver.
    """

    def __init__(self, sweep: Sweep[Any, Any, Any], outbox: ActorHandle) -> None:
        self._sweep, self._outbox = sweep, outbox
        self._fault: BaseException | None = None
        self._told: set[int] = set()

    def ending(self) -> bool:
        """Whether the sweep is to end before all trials have."""
        return self._fault is not None or self._sweep.stopping()

    def settle(self) -> None:
        """After the sweep: raise what the owner raised, and refuse to lose a trial."""
        if self._fault is not None:
            raise self._fault
        trials = self._sweep.trials
        missing = [each.name for n, each in enumerate(trials) if n not in self._told]
        if missing and not self._sweep.stopping():
            raise ClusterError(
                f"cluster: nothing came of {', '.join(missing)}; run the same command to go on"
            )

    def on_trial_result(
        self,
        iteration: int,
        trials: list[TuneTrial],
        trial: TuneTrial,
        result: Mapping[str, Any],
        **_: object,
    ) -> None:
        """Tune's: a trial has reported."""
        number = trial.config["number"]
        if "delivered" in result:
            self._deliver(number)
        else:
            self._pass_on(self._sweep.on_report, number, result)

    def on_trial_error(
        self, iteration: int, trials: list[TuneTrial], trial: TuneTrial, **_: object
    ) -> None:
        """Tune's: a trial has failed for good, which only the death of its worker brings about."""
        number = trial.config["number"]
        if number not in self._told:
            self._told.add(number)
            why = f"its worker died {RETRIES + 1} times over it (out of memory, or a crash)"
            self._pass_on(self._sweep.on_done, number, Done(error=why))

    def __getstate__(self) -> dict[str, Any]:
        """Nothing: Tune writes a sweep down, but what is done its owner knows."""
        return {}

    def _deliver(self, number: int) -> None:
        if number in self._told:
            return
        try:
            done = ray.get(self._outbox.take.remote(number))
        except RayError as error:
            done = Done(error=f"its result was lost: {described(error)}")
        if done is not None:
            self._told.add(number)
            self._pass_on(self._sweep.on_done, number, done)

    def _pass_on(self, hear: Callable[..., None], number: int, news: object) -> None:
        if self._fault is not None:
            return
        try:
            hear(self._sweep.trials[number], news)
        except BaseException as error:
            self._fault = error


class Ender(Stopper):  # type: ignore[misc]  # Ray is untyped here
    """Ends all trials when asked to."""

    def __init__(self, ending: Callable[[], bool]) -> None:
        self._ending = ending

    def __call__(self, trial_id: str, result: Mapping[str, Any]) -> bool:
        """Tune's: no single trial is stopped."""
        return False

    def stop_all(self) -> bool:
        """Tune's: whether all are."""
        return self._ending()

    def __getstate__(self) -> dict[str, Any]:
        """Nothing: Tune writes a sweep down, but what is done its owner knows."""
        return {}
