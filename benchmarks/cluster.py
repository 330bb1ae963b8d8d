"""What a Dask cluster brings: two workers against one, and a schedule for more.

    python -m benchmarks.cluster [--rounds 3]

Folds are those of a report, with all its models. Workers are processes on this machine
with one thread each. Windows of one and of two workers take turns; both are warm. The
schedule for 8 and 64 workers is that of a list scheduler over the times of the same
folds on one worker, drawn with replacement until there are 80 of each of 8 terrains.
Folds are handed out in the groups of `guided_sizes`, one group after the other, each as
long as one of many that do nothing was measured to take. The trials reach the workers
by Dask's tree: whoever has them gives them to two others, one after the other, as long
as was measured of one worker.
"""

import argparse
import heapq
import math
import statistics
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.study.crossval import FoldPlan, plan_folds, run_fold
from analysis.study.jobs import Workers, guided_sizes, run_tasks
from analysis.study.models import REPORTED, FitOptions
from analysis.tables.loading import load_tables
from benchmarks.rows import BenchRow
from benchmarks.study_race import SLICE

FOLDS = 640  # 80 trials of each of 8 terrains
LARGER = (8, 64)  # workers of the schedules
_GOAL = 1.8  # times that two workers are faster than one
_ROUNDS = 3
_IDLE = 300  # groups that do nothing


@dataclass(frozen=True, slots=True)
class ClusterCosts:
    """What was measured of a cluster.

    Attributes:
        tasks: processor time of every fold [s].
        alone: with one worker [s], median of the rounds.
        ratio: of one worker's time and two's in one round, median of the rounds.
        light: until the same folds without a model are back from one warm worker [s].
        sending: until one warm worker has the trials [s].
        beyond: what handing out a group and taking its results costs [s].
    """

    tasks: tuple[float, ...]
    alone: float
    ratio: float
    light: float
    sending: float
    beyond: float

    @property
    def work(self) -> list[float]:
        """Times of the folds on a worker [s]."""
        slower = max(self.alone - self.light, 0.0) / sum(self.tasks)
        return [slower * work for work in self.tasks]


def plan(*models: str) -> FoldPlan:
    """Return the folds of the trials in the repository, for these models."""
    trials = {
        f"{name} {part}": [prepare_trial(one, PrepareOptions()) for one in group]
        for name, group in load_tables([SLICE]).items()
        for part in "abcd"  # many more folds than workers, and an even number
    }
    return plan_folds(trials, FitOptions(models=models))[0]


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


def spent(folds: FoldPlan, address: str) -> float:
    """Return how long a cluster takes for all folds [s]."""
    before = time.perf_counter()
    run_tasks(run_fold, folds, Workers(scheduler=address))
    return time.perf_counter() - before


def handed(folds: FoldPlan, address: str) -> float:
    """Return how long it takes until a worker has what all folds are made from [s]."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        before = time.perf_counter()
        there: Any = client.scatter([folds], broadcast=True, hash=False)
        client.submit(len, there[0], pure=False).result()
        return time.perf_counter() - before


def idle_group(address: str) -> float:
    """Return how long a group of tasks takes that does nothing, one of many [s]."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        before = time.perf_counter()
        client.gather([client.submit(list, (), pure=False) for _ in range(_IDLE)])
        return (time.perf_counter() - before) / _IDLE


def measured(rounds: int = _ROUNDS) -> ClusterCosts:
    """Return what one and two workers take."""
    folds, light = plan(*REPORTED), plan()
    own: list[float] = []
    for k in range(len(folds)):
        before = time.process_time()
        run_fold(folds[k])
        own.append(time.process_time() - before)
    with cluster(1) as one, cluster(2) as two:
        for address in (one, two):
            spent(folds, address)  # workers import what they need
        empty = min(spent(light, one) for _ in range(rounds))
        sending = min(handed(light, one) for _ in range(rounds))
        beyond = min(idle_group(one) for _ in range(rounds))
        pairs = [(spent(folds, one), spent(folds, two)) for _ in range(rounds)]
    alone = statistics.median(a for a, _ in pairs)
    ratio = statistics.median(a / b for a, b in pairs)
    return ClusterCosts(tuple(own), alone, ratio, empty, sending, beyond)


def makespan(
    tasks: Sequence[float], workers: int, beyond: float, sending: float
) -> float:
    """Return when the last of the tasks is done [s].

    Args:
        tasks: work of each [s], in the order in which they are handed out.
        workers: number of workers.
        beyond: what the scheduler needs to hand out a group [s], one after the other.
        sending: from one that has the trials to the next one [s].
    """
    rounds = (math.ceil(math.log(k + 1, 3) - 1e-9) for k in range(workers))
    free = [sending * (1 + 2 * r) for r in rounds]
    heapq.heapify(free)
    given, left = 0.0, iter(tasks)
    for size in guided_sizes(len(tasks), workers):
        given += beyond
        work = sum(islice(left, size))
        heapq.heappush(free, max(heapq.heappop(free), given) + work)
    return max(free)


def efficiency(costs: ClusterCosts, workers: int) -> float:
    """Return how much of their time so many workers would work, 0 to 1."""
    drawn = np.random.default_rng(0).choice(costs.work, FOLDS).tolist()
    whole = makespan(drawn, workers, costs.beyond, costs.sending)
    return sum(drawn) / (workers * whole)


def rows() -> list[BenchRow]:
    """Return what was measured, for the table."""
    costs = measured()
    count = len(costs.tasks)
    return [
        BenchRow(
            f"Dask: two workers against one, {count} folds",
            costs.ratio,
            "times",
            _GOAL,
            is_least=True,
        ),
        *(
            BenchRow(
                f"Dask: {workers} workers busy, {FOLDS} folds, schedule",
                100.0 * efficiency(costs, workers),
                "%",
                note=f"{1e3 * costs.beyond:.1f} ms a group beyond its work, "
                f"{1e3 * costs.sending:.0f} ms to give a worker the trials",
            )
            for workers in LARGER
        ),
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=_ROUNDS)
    costs = measured(parser.parse_args().rounds)
    print(costs)
    for workers in (1, 2, *LARGER):
        print(f"{workers} workers: {efficiency(costs, workers):.0%} busy")


if __name__ == "__main__":
    main()
