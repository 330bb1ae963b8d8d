"""The one door to joblib: independent tasks on the cores of this machine."""

import os
from collections.abc import Callable, Sequence
from typing import TypeVar

from joblib import Parallel, delayed, parallel_config

Task = TypeVar("Task")
Result = TypeVar("Result")
Progress = Callable[[int, int], None]

_FEW = 3  # tasks that cost less than starting workers


def available_cores() -> int:
    """Return the number of cores this process may use."""
    return max(1, len(os.sched_getaffinity(0)))


def run_tasks(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    n_jobs: int | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """Return `function` of every task, in the order of the tasks.

    The function must be pure, so that the results do not depend on the number of
    workers. Workers have one linear-algebra thread each: for matrices of a few hundred
    rows more threads lose time.

    Args:
        function: importable by name, called with one task.
        tasks: what to do.
        n_jobs: number of processes; by default one per core, and none beside this one
            for three tasks or fewer.
        progress: called with (done, total) after every task.
    """
    workers = min(available_cores() if n_jobs is None else n_jobs, len(tasks))
    if workers <= 1 or (n_jobs is None and len(tasks) <= _FEW):
        results = map(function, tasks)
        return _collect(results, len(tasks), progress)
    with parallel_config("loky", n_jobs=workers, inner_max_num_threads=1):
        stream = Parallel(return_as="generator")(delayed(function)(t) for t in tasks)
        return _collect(stream, len(tasks), progress)


def _collect(results, total: int, progress: Progress | None) -> list:  # noqa: ANN001
    collected = []
    for result in results:
        collected.append(result)
        if progress is not None:
            progress(len(collected), total)
    return collected
