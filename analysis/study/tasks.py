"""Execution of the independent tasks of a study."""

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any, TypeVar

from acquisition.cores import available_cores
from acquisition.linear_algebra import keep_heap
from analysis.study.cluster import run_on_cluster
from analysis.study.store import ResultStore
from analysis.study.worker_processes import Call, run_on_processes, running_workers

Task = TypeVar("Task")
Result = TypeVar("Result")
Progress = Callable[[int, int], None]
TaskIndex = tuple[int, int]  # (batch, task in the batch)

_FEW = 3  # number of tasks that cost less than starting workers


@dataclass(frozen=True, slots=True)
class Workers:
    """Where tasks run; does not affect the results.

    Attributes:
        n_jobs: number of processes; by default one per core, or those already running
            for three tasks or fewer.
        scheduler: address of a Dask scheduler, on this machine or by TLS, e.g.
            "tcp://127.0.0.1:8786"; None for local processes. Its workers need the same
            version of this project.
    """

    n_jobs: int | None = None
    scheduler: str | None = None

    def count(self, tasks: int) -> int:
        """Return the number of local processes for this many tasks."""
        if self.n_jobs is not None or tasks < 2:
            return min(self.n_jobs or 1, tasks)
        return available_cores() if tasks > _FEW else running_workers()


@dataclass(frozen=True, slots=True)
class Batch:
    """Tasks of one kind.

    Attributes:
        function: pure, importable by name, called with one task.
        tasks: arguments, one per call.
    """

    function: Callable[[Any], Any]
    tasks: Sequence[Any]


def run_tasks(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    workers: Workers | int | None = None,
    progress: Progress | None = None,
    store: ResultStore | None = None,
) -> list[Result]:
    """Apply `function` to every task; results are in the order of the tasks.

    The function must be pure. Every task runs with one linear-algebra thread, here and
    in workers: more threads are slower for matrices of a few hundred rows, and one
    thread makes results bitwise equal for any number of workers.

    Args:
        function: importable by name, called with one task.
        tasks: arguments, one per call.
        workers: where to run, or just the number of processes.
        progress: called with (done, total) after every task.
        store: cache of earlier results; new ones are stored as they complete.

    Raises:
        SettingsError: the scheduler does not answer, or is reached without TLS.
        WorkerLostError: a process ended while it worked on a task.
        MissingLibraryError: Dask is not installed.
    """
    (results,) = run_batches([Batch(function, tasks)], workers, progress, store)
    return results


def run_batches(
    batches: Sequence[Batch],
    workers: Workers | int | None = None,
    progress: Progress | None = None,
    store: ResultStore | None = None,
) -> list[list[Any]]:
    """Return the results of every batch, as `run_tasks` does.

    No core idles between batches. Progress counts the tasks of all batches.
    """
    keep_heap()  # also speeds up fits in this process
    where = workers if isinstance(workers, Workers) else Workers(workers)
    indices = [
        (k, n) for k, batch in enumerate(batches) for n in range(len(batch.tasks))
    ]
    results = {} if store is None else _cached(store, batches, indices)
    if progress is not None and results:
        progress(len(results), len(indices))
    calls = [
        (_one_threaded, batches[k].function, (k, n), batches[k].tasks[n])
        for k, n in indices
        if (k, n) not in results
    ]
    with closing(_completed(calls, where)) as completed:  # ends running calls on error
        for (k, n), result in completed:
            results[k, n] = result
            if store is not None:
                store.put(batches[k].function, batches[k].tasks[n], result)
            if progress is not None:
                progress(len(results), len(indices))
    return [
        [results[k, n] for n in range(len(batch.tasks))]
        for k, batch in enumerate(batches)
    ]


def _cached(
    store: ResultStore, batches: Sequence[Batch], indices: Sequence[TaskIndex]
) -> dict[TaskIndex, Any]:
    results: dict[TaskIndex, Any] = {}
    for k, n in indices:
        result = store.get(batches[k].function, batches[k].tasks[n])
        if result is not None:
            results[k, n] = result
    return results


def _completed(
    calls: Sequence[Call], where: Workers
) -> Generator[tuple[TaskIndex, Any]]:
    """Yield (index, result) of every call, in any order."""
    count = where.count(len(calls))
    if where.scheduler is not None and calls:
        yield from run_on_cluster(calls, where.scheduler)
    elif count > 1:
        yield from run_on_processes(calls, count)
    else:
        yield from (function(*arguments) for function, *arguments in calls)


def _one_threaded(
    function: Callable[[Any], Any],
    index: TaskIndex,
    task: Any,  # noqa: ANN401
) -> tuple[TaskIndex, Any]:
    # The limit affects only loaded libraries, and SciPy has its own BLAS: import first.
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_limits

    keep_heap()
    with threadpool_limits(1):
        return index, function(task)
