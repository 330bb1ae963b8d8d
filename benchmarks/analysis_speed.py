"""Cost of the analysis: loading a trial, fitting a fold, querying a terrain table.

    python -m benchmarks.analysis_speed

Times are processor time, the best of a few repeats; memory is that allocated by Python
and numpy.
"""

import tempfile
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from acquisition.linear_algebra import keep_heap
from analysis.data.load import load_trial
from analysis.data.prepare import PreparedTrial, PrepareOptions, prepare_trial
from analysis.report.reduced_trial import ReducedTrial
from analysis.study.crossval import run_fold
from analysis.study.models import REPORTED
from analysis.terrains.table import Table
from benchmarks.fit import EVALUATION, chosen, evaluation_function, load_rows
from benchmarks.rows import BenchRow
from benchmarks.study_race import SLICE, folds_of
from experiments.__main__ import main as traction

_SECONDS = 30.0  # length of a trial
_TRIALS_IN_MEMORY = 8


def best(function: Callable[[], object], repeats: int, calls: int = 1) -> float:
    """Return the smallest processor time of one call [s]."""
    times: list[float] = []
    for _ in range(repeats):
        before = time.process_time()
        for _ in range(calls):
            function()
        times.append((time.process_time() - before) / calls)
    return min(times)


def trial_rows() -> list[BenchRow]:
    """Return time and memory of a simulated trial, scaled to 30 s of recording."""
    with tempfile.TemporaryDirectory() as folder:
        options = "run S0 --fake --fast --operator-script auto --trials 1"
        if traction([*options.split(), "--data", folder]):
            raise RuntimeError("the session was not recorded")
        (path,) = Path(folder).glob("sessions/*/trials/T01.mcap")
        seconds = float(np.ptp(load_trial(path).t))
        cpu_s = best(lambda: load_trial(path).series(), 7) * _SECONDS / seconds
        size = trial_bytes(path) * _SECONDS / seconds
    what = "one trial of 30 s loaded, all derived arrays"
    return [
        BenchRow(what, 1e3 * cpu_s, "ms", 12),
        BenchRow("report's memory per trial of 30 s", size / 1e6, "MB", 1),
    ]


def trial_bytes(path: Path) -> float:
    """Return the memory that a report keeps per trial, prepared samples included."""
    _loaded(path)  # fills caches that all trials share
    tracemalloc.start()
    trials = [_loaded(path) for _ in range(_TRIALS_IN_MEMORY)]
    used = tracemalloc.get_traced_memory()[0] / len(trials)
    tracemalloc.stop()
    return used


def _loaded(path: Path) -> tuple[ReducedTrial, PreparedTrial]:
    trial = ReducedTrial.of(load_trial(path))
    return trial, prepare_trial(trial.series, PrepareOptions())


def worker_rows() -> list[BenchRow]:
    """Return the cost of a fold of the report's models in a study's worker.

    The second row is the cost of one likelihood evaluation with its gradient.
    """
    keep_heap()
    task = folds_of(SLICE)[0]
    task = replace(task, options=replace(task.options, models=REPORTED))
    what = f"a fold of the report's {len(REPORTED)} models"
    evaluate = evaluation_function(*chosen(load_rows()))
    with threadpool_limits(1):
        fold_s, evaluation_s = best(lambda: run_fold(task), 2), best(evaluate, 5, 20)
    return [
        BenchRow(what, fold_s, "s", 0.4),
        BenchRow(f"{EVALUATION} in a study's worker", 1e3 * evaluation_s, "ms", 1.15),
    ]


def table_rows() -> list[BenchRow]:
    """Return the cost of queries to a terrain database."""
    rng = np.random.default_rng(1)
    loads, speeds = np.linspace(0.5, 20.0, 20), np.linspace(0.005, 0.2, 16)
    forces = np.sort(rng.normal(size=(9, 20, 16)), axis=0)
    rows = tuple(tuple(map(tuple, grid)) for grid in forces.tolist())
    shares = tuple(np.linspace(0.01, 0.99, 9).tolist())
    table = Table(tuple(loads.tolist()), tuple(speeds.tolist()), shares, rows)
    cpu_s: dict[int, float] = {}
    for count, calls in ((10, 1000), (100_000, 3)):
        F_n, v_t = rng.uniform(0.5, 20.0, count), rng.uniform(0.005, 0.2, count)
        cpu_s[count] = best(lambda F=F_n, v=v_t: table.over(F, v), 5, calls)
    return [
        BenchRow("terrain database, 10 points", 1e6 * cpu_s[10], "us", 8),
        BenchRow("terrain database, 100,000 points", 1e3 * cpu_s[100_000], "ms", 10),
    ]


def rows() -> list[BenchRow]:
    """Return the measurements as table rows."""
    return [*trial_rows(), *worker_rows(), *table_rows()]


if __name__ == "__main__":
    for line in rows():
        print("  ".join(line.cells()))
