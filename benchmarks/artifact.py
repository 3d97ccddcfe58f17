"""Disk and memory of a saved replanner, and its time from the process that uses it.

Run: ``python -m benchmarks.artifact``. Data and networks as in :mod:`benchmarks.planner`: 25,000
rows, the paper's layers. Memory is what a fresh process holds resident beyond NumPy (Linux): as
data what loading a replanner and planning with it allocates, as code what importing the planner
adds and the pages of shared libraries that planning touches.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.planner import WEIGHTS, briefly_trained, library_and_queries
from lmtr.models.mode_regressor import fit_mode_regressor
from lmtr.models.settings import ModeRegressorSettings
from lmtr.policies.gaussian_policy import GaussianModePolicy
from lmtr.replanners import artifact
from lmtr.replanners.selecting import Selection
from lmtr.robot.model import ANYMAL

PROCESS = """
import json, sys
from time import perf_counter
import numpy as np

def resident():
    with open("/proc/self/status") as status:
        kB = dict(line.split()[:2] for line in status if line.startswith("Rss"))
    return int(kB["RssAnon:"]) / 1e3, int(kB["RssFile:"]) / 1e3

from pathlib import Path
x = np.load(sys.argv[2], mmap_mode="r")
at = [resident()]
from lmtr.replanners import artifact
at.append(resident())
begun = perf_counter()
replanner = artifact.load(Path(sys.argv[1]))
loading = perf_counter() - begun
taken = []
for row in range(100 + len(x)):
    task = np.array(x[row % len(x)])[None]
    begun = perf_counter()
    replanner.plan(task)
    if row >= 100:
        taken.append(1e3 * (perf_counter() - begun))
at.append(resident())
(imported, library), (own, used) = np.diff(at, axis=0)
code = imported + library + used
print(json.dumps([code, own, 1e3 * loading, np.median(taken), np.percentile(taken, 99)]))
"""


def main() -> None:
    data, x = library_and_queries()
    unimodal, lmtr = (briefly_trained(n, data) for n in (0, 6))
    network = fit_mode_regressor(lmtr, data, ModeRegressorSettings(epochs=1))
    saved = {
        "unimodal": (unimodal, {}),
        "LMTR-6": (lmtr, {}),
        "LMTR-6, best of 16": (lmtr, {"selection": Selection(candidates=16)}),
        "LMTR-6, π_N": (lmtr, {"policy": GaussianModePolicy(network, lmtr.task_scaling)}),
        "library": (None, {}),
    }
    print("MB on disk; MB resident beyond NumPy for code and for data; ms to load, ms per plan")
    print(f"{'':20}{'disk':>7}{'code':>7}{'data':>7}{'load':>8}{'median':>9}{'p99':>8}")
    with tempfile.TemporaryDirectory() as scratch:
        tasks = Path(scratch, "x.npy")
        np.save(tasks, x)
        for name, (model, changes) in saved.items():
            folder = Path(scratch, name)
            artifact.save(folder, model, data, WEIGHTS, ANYMAL, **changes)
            disk = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
            command = [sys.executable, "-c", PROCESS, str(folder), str(tasks)]
            said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            code, own, loading, median, late = json.loads(said)
            memory = f"{disk / 1e6:7.1f}{code:7.1f}{own:7.1f}"
            print(f"{name:20}{memory}{loading:8.0f}{median:9.2f}{late:8.2f}")


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
