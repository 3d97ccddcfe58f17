"""Sweeps: trials are told of as they end, fail alone, and stop when asked to."""

import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from services.cluster import Sweep, Trial
from services.cluster.sweep import gpu_share
from services.errors import ClusterError


def fitted(config, data, report):
    """Adds to the sum of the data, or does what the configuration says."""
    report({"epoch": 1.0, "loss": float(config["add"])})
    if config.get("fails"):
        raise ValueError("bad apple")
    once = config.get("dies_once")
    if once and not Path(once).exists():
        Path(once).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if config.get("dies"):
        os.kill(os.getpid(), signal.SIGKILL)
    if config.get("unsendable"):
        return threading.Lock()
    for _ in range(config.get("beats", 0)):
        time.sleep(0.1)
        report({"epoch": 2.0})
    return float(data.sum()) + config["add"]


class Owner:
    """Keeps what it hears."""

    def __init__(self, stops_after=None):
        self.reports, self.done, self.stops_after = [], {}, stops_after
        self.lock = threading.Lock()  # an owner need not be one that pickle can take

    def sweep(self, configs, **options):
        trials = [Trial(f"t{number}", config) for number, config in enumerate(configs)]
        return Sweep(
            fitted, trials, np.arange(10.0), self.on_report, self.on_done, self.stopping, **options
        )

    def on_report(self, trial, metrics):
        self.reports.append((trial.name, dict(metrics)))

    def on_done(self, trial, done):
        assert trial.name not in self.done
        self.done[trial.name] = done

    def stopping(self):
        return self.stops_after is not None and len(self.done) >= self.stops_after


def test_every_trial_reports_and_gives_its_result(cluster):
    owner = Owner()
    cluster.sweep(owner.sweep([{"add": add} for add in range(5)]))
    assert {name: done.result for name, done in owner.done.items()} == {
        f"t{add}": 45.0 + add for add in range(5)
    }
    heard = {name: metrics["loss"] for name, metrics in owner.reports}
    assert heard == {f"t{add}": float(add) for add in range(5)}


def test_a_trial_that_raises_fails_alone_and_says_why(cluster):
    owner = Owner()
    cluster.sweep(owner.sweep([{"add": 0}, {"add": 1, "fails": True}, {"add": 2}]))
    assert owner.done["t1"].error == "ValueError: bad apple"
    assert "fitted" in owner.done["t1"].traceback
    assert [owner.done[name].result for name in ("t0", "t2")] == [45.0, 47.0]


def test_a_stop_keeps_what_is_done_and_begins_no_more(cluster):
    owner = Owner(stops_after=1)
    cluster.sweep(owner.sweep([{"add": add, "beats": 20 * bool(add)} for add in range(8)]))
    assert owner.done["t0"].result == 45.0
    assert len(owner.done) < 4


def test_what_the_owner_raises_ends_the_sweep_and_reaches_the_caller(cluster):
    owner = Owner()

    def refuse(trial, done):
        raise OSError("disk full")

    sweep = Sweep(fitted, [Trial("t0", {"add": 0})], np.zeros(1), owner.on_report, refuse)
    with pytest.raises(OSError, match="disk full"):
        cluster.sweep(sweep)


@pytest.mark.slow
def test_a_trial_whose_worker_died_is_begun_again_a_few_times(ray_on_this_machine, tmp_path):
    owner = Owner()
    configs = [{"add": 0, "dies_once": str(tmp_path / "died")}, {"add": 1, "dies": True}]
    ray_on_this_machine.sweep(owner.sweep([*configs, {"add": 2}]))
    assert owner.done["t0"].result == 45.0
    assert "its worker died 4 times over it" in owner.done["t1"].error
    assert owner.done["t2"].result == 47.0


def test_a_result_that_cannot_be_sent_is_its_trials_fault(ray_on_this_machine):
    owner = Owner()
    ray_on_this_machine.sweep(owner.sweep([{"add": 0, "unsendable": True}, {"add": 1}]))
    assert "its result cannot be sent back: TypeError" in owner.done["t0"].error
    assert owner.done["t1"].result == 46.0


def test_nothing_of_tune_is_seen_or_left(ray_on_this_machine, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    ray_on_this_machine.sweep(Owner().sweep([{"add": 0}, {"add": 1, "fails": True}]))
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("device", "gpus", "slots", "share"),
    [
        ("cpu", 1, 4, 0.0),
        ("auto", 0, 4, 0.0),
        ("auto", 1, 1, 1.0),
        ("auto", 1, 4, 0.25),
        ("cuda", 2, 5, 1 / 3),
        ("auto", 1, 64, 1 / 8),
        ("auto", 8, 2, 1.0),
    ],
)
def test_trials_share_the_gpus_so_that_all_slots_are_busy(device, gpus, slots, share):
    assert gpu_share(device, gpus, slots) == pytest.approx(share)


def test_a_gpu_that_is_not_there_is_asked_for_in_vain():
    with pytest.raises(ClusterError, match="device 'cuda' is asked for and the cluster has no GPU"):
        gpu_share("cuda", 0, 4)


def test_a_cluster_without_a_gpu_says_so_before_it_begins(ray_on_this_machine):
    owner = Owner()
    with pytest.raises(ClusterError, match="no GPU"):
        ray_on_this_machine.sweep(owner.sweep([{"add": 0}], device="cuda"))
    assert owner.done == {}
