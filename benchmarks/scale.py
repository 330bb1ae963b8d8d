"""How cost grows: folds with the number of trials, `status` with that of sessions.

    python -m benchmarks.scale [--json]

Time is processor time, memory the peak of what Python and numpy allocate. The exponent
is that of the growth from the largest but one size to the largest; beyond 1.25, which
leaves room for a busy machine, the exit code is 1. Folds carry their trials: up to the
50 trials of a terrain that are left out one by one, here 400 trials, planning grows
with their square.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
import tracemalloc
from pathlib import Path
from pickle import dumps
from types import SimpleNamespace
from typing import Any

import numpy as np

from analysis.study.crossval import plan_folds, run_fold
from analysis.study.models import FitOptions
from analysis.study.store import task_key
from benchmarks.made_sessions import TERRAINS, make_sessions
from benchmarks.rows import BenchRow

TRIALS, SESSIONS = (10, 80, 400, 1600), (10, 100, 1000)
_KEPT = 450  # rows of a trial that models are fitted to
_LINEAR = 1.25
_REPEATS = 3


def made_trials(count: int) -> dict[str, list[Any]]:
    """Return prepared trials on eight terrains that have only their kept samples."""
    noise = np.random.default_rng(count)
    trials: dict[str, list[Any]] = {}
    for k in range(count):
        F_n, v_t, F_t = noise.normal(size=(3, _KEPT))
        made = SimpleNamespace(
            name=f"T{k}", kept=_KEPT, F_n=F_n, v_t=v_t, F_t=F_t, further=None
        )
        trials.setdefault(TERRAINS[k % len(TERRAINS)], []).append(made)
    return trials


def folds_of(count: int) -> dict[str, float]:
    """Return what planning so many folds takes, and what is shipped with one."""
    trials, times = made_trials(count), []
    for _ in range(_REPEATS):
        start = time.process_time()
        tasks, _ = plan_folds(trials, FitOptions())
        for task in tasks:
            task_key(run_fold, task)
        times.append(time.process_time() - start)
    tracemalloc.start()
    tasks, _ = plan_folds(trials, FitOptions())
    for task in tasks:
        task_key(run_fold, task)
    shipped = max(len(dumps(task)) for task in tasks)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return {
        "count": count,
        "seconds": min(times),
        "megabytes": peak / 1e6,
        "shipped": shipped / 1e6,
    }


def status_of(count: int) -> dict[str, float]:
    """Return the processor time of `traction status` over so many sessions [s].

    The second look counts, at files that have not changed; the first one hashes all.
    """
    with tempfile.TemporaryDirectory() as folder:
        data, home = Path(folder) / "data", Path(folder) / "cache"
        make_sessions(data, count)
        time.sleep(2.1)  # what has just changed is read again
        _status(data, home)
        times = [_status(data, home) for _ in range(_REPEATS)]
    return {"count": count, "seconds": min(times)}


def _status(data: Path, home: Path) -> float:
    """Return the processor time of one status [s]."""
    before = os.times()
    subprocess.run(
        [sys.executable, "-m", "traction", "status", "--data", str(data)],
        env={**os.environ, "XDG_CACHE_HOME": str(home)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        check=True,
    )
    after = os.times()
    return (
        after.children_user
        + after.children_system
        - before.children_user
        - before.children_system
    )


def exponent(points: list[dict[str, float]], key: str) -> float:
    """Return p of cost ~ size^p between the two largest sizes."""
    *_, small, large = points
    growth = math.log(large[key] / small[key])
    return growth / math.log(large["count"] / small["count"])


def measured() -> dict[str, Any]:
    """Return costs by size."""
    with tempfile.TemporaryDirectory() as folder:
        empty = Path(folder) / "data"
        _status(empty, Path(folder))
        nothing = min(_status(empty, Path(folder)) for _ in range(_REPEATS))
    return {
        "folds": [folds_of(count) for count in TRIALS],
        "boards": [status_of(count) for count in SESSIONS],
        "empty": nothing,
    }


def rows_of(found: dict[str, Any]) -> list[BenchRow]:
    """Return the table's lines."""
    folds, statuses = found["folds"], found["boards"]
    last, status = folds[-1], statuses[-1]
    unchanged = "`status`, 1,000 sessions, nothing changed"
    grown = {
        "planning grows as trials to the power of": exponent(folds, "seconds"),
        "its memory grows to the power of": exponent(folds, "megabytes"),
        "what is shipped with a fold, to the power of": exponent(folds, "shipped"),
        "`status` grows as sessions to the power of": exponent(statuses, "seconds"),
    }
    return [
        BenchRow("folds of 1,600 trials: memory", last["megabytes"], "MB", 300),
        BenchRow("folds of 1,600 trials: planned and known", last["seconds"], "s", 5),
        BenchRow("folds of 1,600 trials: shipped with one", last["shipped"], "MB", 4),
        BenchRow("`status`, an empty folder", 1e3 * found["empty"], "ms", 150),
        BenchRow(unchanged, status["seconds"], "s", 1.0),
        *(BenchRow(what, power, "", _LINEAR) for what, power in grown.items()),
    ]


def rows() -> list[BenchRow]:
    """Return what was measured, for the table."""
    return rows_of(measured())


def main() -> int:
    """Print costs by size and what they grow with; 1 beyond linear."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    arguments = parser.parse_args()
    found = measured()
    lines = rows_of(found)
    if arguments.json:
        print(json.dumps(found | {"rows": [row.plain() for row in lines]}, indent=1))
    else:
        for point in [*found["folds"], *found["boards"]]:
            print("  ".join(f"{key} {value:.3g}" for key, value in point.items()))
        for row in lines:
            print("  ".join(row.cells()))
    grown = [row for row in lines if "power" in row.what and row.verdict == "not met"]
    return 1 if grown else 0


if __name__ == "__main__":
    sys.exit(main())
