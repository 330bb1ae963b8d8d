"""Speed-up of two workers over one, on this machine and on a Dask cluster.

    python -m benchmarks.cluster [--rounds 3]

The folds are those of a report with all its models. On this machine, one worker means
this process; the cluster's workers are local processes with one thread each. One and
two workers take turns, after a warm-up.
"""

import argparse
import statistics
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.study.crossval import FoldTask, plan_folds, run_fold
from analysis.study.models import REPORTED, FitOptions
from analysis.study.tasks import Workers, run_tasks
from analysis.tables.loading import load_tables
from benchmarks.rows import BenchRow
from benchmarks.study_race import SLICE

_GOAL = 1.7  # speed-up of two workers over one
_ROUNDS = 3


def planned() -> list[FoldTask]:
    """Return the folds of the trials in the repository."""
    trials = {
        f"{name} {part}": [prepare_trial(s, PrepareOptions()) for s in group]
        for name, group in load_tables([SLICE]).items()
        for part in "abcd"  # many more folds than workers, and an even number
    }
    return plan_folds(trials, FitOptions(models=REPORTED))[0]


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """Run a Dask cluster on this machine; yield the scheduler's address."""
    from distributed import LocalCluster

    local: Any = LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        silence_logs=50,
    )
    with local:
        yield local.scheduler_address


def wall_time(folds: Sequence[FoldTask], workers: Workers) -> float:
    """Return the wall time of all folds [s]."""
    before = time.perf_counter()
    run_tasks(run_fold, folds, workers)
    return time.perf_counter() - before


def gain(
    folds: Sequence[FoldTask], one: Workers, two: Workers, rounds: int = _ROUNDS
) -> float:
    """Return the speed-up of two workers over one, median of the rounds."""
    for workers in (one, two):
        wall_time(folds[:4], workers)  # warm-up: the workers import their modules
    return statistics.median(
        wall_time(folds, one) / wall_time(folds, two) for _ in range(rounds)
    )


def rows(rounds: int = _ROUNDS) -> list[BenchRow]:
    """Return the measurements as table rows."""
    folds = planned()
    gains = {"this machine": gain(folds, Workers(1), Workers(2), rounds)}
    with cluster(1) as one, cluster(2) as two:
        ends = Workers(scheduler=one), Workers(scheduler=two)
        gains["Dask"] = gain(folds, *ends, rounds)
    return [
        BenchRow(
            f"{where}: two workers against one, {len(folds)} folds",
            ratio,
            "times",
            _GOAL,
            is_lower_bound=True,
        )
        for where, ratio in gains.items()
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=_ROUNDS)
    for row in rows(parser.parse_args().rounds):
        print("  ".join(row.cells()))


if __name__ == "__main__":
    main()
