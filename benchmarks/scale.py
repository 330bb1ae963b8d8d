"""Growth of cost: folds with the number of trials, `status` with that of sessions.

    python -m benchmarks.scale [--json]

Time is processor time, memory the peak allocated by Python and numpy. The exponent is
that between the two largest sizes; above 1.25, which leaves room for a busy machine,
the exit code is 1. Folds carry their trials: up to 50 trials per terrain, which are
held out one at a time (here 400 trials), planning grows quadratically.
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
from benchmarks.generated_sessions import TERRAINS, make_sessions
from benchmarks.rows import BenchRow

TRIALS, SESSIONS = (10, 80, 400, 1600), (10, 100, 1000)
_KEPT = 450  # kept samples per trial
_LINEAR = 1.25
_REPEATS = 3


def generated_trials(count: int) -> dict[str, list[Any]]:
    """Return generated trials on eight terrains, with kept samples only."""
    noise = np.random.default_rng(count)
    trials: dict[str, list[Any]] = {}
    for k in range(count):
        F_n, v_t, F_t = noise.normal(size=(3, _KEPT))
        trial = SimpleNamespace(
            name=f"T{k}", kept=_KEPT, F_n=F_n, v_t=v_t, F_t=F_t, further=None
        )
        trials.setdefault(TERRAINS[k % len(TERRAINS)], []).append(trial)
    return trials


def folds_of(count: int) -> dict[str, float]:
    """Return the cost of planning the folds of `count` trials, and a fold's size."""
    trials, times = generated_trials(count), []
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
    """Return the processor time of `traction status` over `count` sessions [s].

    The runs after the first count, on unchanged files; the first run hashes all.
    """
    with tempfile.TemporaryDirectory() as folder:
        data, home = Path(folder) / "data", Path(folder) / "cache"
        make_sessions(data, count)
        time.sleep(2.1)  # recently changed files would be read again
        _status(data, home)
        times = [_status(data, home) for _ in range(_REPEATS)]
    return {"count": count, "seconds": min(times)}


def _status(data: Path, home: Path) -> float:
    """Return the processor time of one `traction status` [s]."""
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
    """Return the costs by size."""
    with tempfile.TemporaryDirectory() as folder:
        empty = Path(folder) / "data"
        _status(empty, Path(folder))
        of_empty = min(_status(empty, Path(folder)) for _ in range(_REPEATS))
    return {
        "folds": [folds_of(count) for count in TRIALS],
        "boards": [status_of(count) for count in SESSIONS],
        "empty": of_empty,
    }


def rows_of(costs: dict[str, Any]) -> list[BenchRow]:
    """Return the costs as table rows."""
    folds, statuses = costs["folds"], costs["boards"]
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
        BenchRow("`status`, an empty folder", 1e3 * costs["empty"], "ms", 150),
        BenchRow(unchanged, status["seconds"], "s", 1.0),
        *(BenchRow(what, power, "", _LINEAR) for what, power in grown.items()),
    ]


def rows() -> list[BenchRow]:
    """Return the measurements as table rows."""
    return rows_of(measured())


def main() -> int:
    """Print the costs by size and their exponents; return 1 if one is too large."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    arguments = parser.parse_args()
    costs = measured()
    lines = rows_of(costs)
    if arguments.json:
        print(json.dumps(costs | {"rows": [row.plain() for row in lines]}, indent=1))
    else:
        for point in [*costs["folds"], *costs["boards"]]:
            print("  ".join(f"{key} {value:.3g}" for key, value in point.items()))
        for row in lines:
            print("  ".join(row.cells()))
    grown = [row for row in lines if "power" in row.what and row.verdict == "not met"]
    return 1 if grown else 0


if __name__ == "__main__":
    sys.exit(main())
