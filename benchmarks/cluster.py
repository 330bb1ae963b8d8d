"""Two workers against one: on this machine, and on a Dask cluster.

    python -m benchmarks.cluster [--rounds 3]

Folds are those of a report, with all its models. On this machine one worker is this
process; a cluster's are processes here with one thread each. One and two workers take
turns, and all are warm.
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

_GOAL = 1.7  # times that two workers are faster than one
_ROUNDS = 3


def planned() -> list[FoldTask]:
    """Return the folds of the trials in the repository."""
    trials = {
        f"{name} {part}": [prepare_trial(one, PrepareOptions()) for one in group]
        for name, group in load_tables([SLICE]).items()
        for part in "abcd"  # many more folds than workers, and an even number
    }
    return plan_folds(trials, FitOptions(models=REPORTED))[0]


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """Run so many workers on this machine; yield the scheduler's address."""
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


def spent(folds: Sequence[FoldTask], where: Workers) -> float:
    """Return how long all folds take [s]."""
    before = time.perf_counter()
    run_tasks(run_fold, folds, where)
    return time.perf_counter() - before


def gain(
    folds: Sequence[FoldTask], one: Workers, two: Workers, rounds: int = _ROUNDS
) -> float:
    """Return how much faster two workers are than one, median of the rounds."""
    for where in (one, two):
        spent(folds[:4], where)  # workers import what they need
    return statistics.median(
        spent(folds, one) / spent(folds, two) for _ in range(rounds)
    )


def rows(rounds: int = _ROUNDS) -> list[BenchRow]:
    """Return what was measured, for the table."""
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
            is_least=True,
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
