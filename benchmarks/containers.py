"""Throughput of a generation in containers against the same outside: alternated, as a ratio.

    python -m benchmarks.containers --head lmtr_head_1 --solutions 200 --rounds 3

The cluster must be up and idle with as many workers as the machine has processors, one each.
Throughput is that of the rows' own times, from
the first to the last, so that starting Ray does not count on either side; each side compiles its
expert before the first round.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

TIMES = "SELECT count(*) AS n, epoch(max(created_at)) - epoch(min(created_at)) AS s FROM solutions"


def main() -> None:
    """Alternate, print both rates of each round, and the ratio of the medians."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--docker", default="docker", help="client of the engine")
    parser.add_argument("--head", required=True, help="name of the head's container")
    parser.add_argument("--solutions", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    inside = [asked.docker, "exec", asked.head, "lmtr"]
    outside = [sys.executable, "-m", "pipelines"]
    with tempfile.TemporaryDirectory(prefix="lmtr-containers-") as folder:
        local = ["--set", f"cluster.workers={asked.workers}"]
        there = ["--set", "cluster.address=auto"]
        rate(inside, "/data/benchmark-warm", 8, 0, there)
        rate(outside, f"{folder}/warm", 8, 0, local)
        rates: dict[str, list[float]] = {"outside": [], "inside": []}
        for turn in range(asked.rounds):
            rates["outside"].append(rate(outside, f"{folder}/{turn}", asked.solutions, turn, local))
            home = f"/data/benchmark-{Path(folder).name}-{turn}"
            rates["inside"].append(rate(inside, home, asked.solutions, turn, there))
            print(", ".join(f"{side} {made[-1]:.2f}/s" for side, made in rates.items()), flush=True)
    ratio = statistics.median(rates["inside"]) / statistics.median(rates["outside"])
    print(f"inside / outside: {ratio:.3f}")


def rate(lmtr: Sequence[str], home: str, count: int, seed: int, options: Sequence[str]) -> float:
    """Solutions per second of one generation."""
    generate = ["--home", home, "generate", "--solutions", str(count), "--seed", str(seed)]
    subprocess.run([*lmtr, *generate, *options], check=True, capture_output=True)
    query = ["--home", home, "query", "--format", "json", TIMES]
    told = subprocess.run([*lmtr, *query], check=True, capture_output=True, text=True)
    (row,) = json.loads(told.stdout)
    return float((row["n"] - 1) / row["s"])


if __name__ == "__main__":
    main()
