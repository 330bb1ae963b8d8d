"""Independent tasks: what a study consists of, wherever they run."""

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any, TypeVar

from acquisition.cores import available_cores
from acquisition.linear_algebra import keep_memory
from analysis.study.cluster import run_on_cluster
from analysis.study.store import ResultStore
from analysis.study.worker_processes import Call, run_on_processes, running_workers

Task = TypeVar("Task")
Result = TypeVar("Result")
Progress = Callable[[int, int], None]
TaskIndex = tuple[int, int]  # of a task: number of its batch, and in it

_FEW = 3  # tasks that cost less than starting workers


@dataclass(frozen=True, slots=True)
class Workers:
    """Where tasks run; never what they return.

    Attributes:
        n_jobs: number of processes; by default one per core, and for three tasks or
            fewer those that are running.
        scheduler: address of a Dask scheduler, on this machine or by TLS, e.g.
            "tcp://127.0.0.1:8786"; None for processes of this one. Its workers need the
            same version of this project.
    """

    n_jobs: int | None = None
    scheduler: str | None = None

    def count(self, tasks: int) -> int:
        """Return the number of local processes for so many tasks."""
        if self.n_jobs is not None or tasks < 2:
            return min(self.n_jobs or 1, tasks)
        return available_cores() if tasks > _FEW else running_workers()


@dataclass(frozen=True, slots=True)
class Batch:
    """Tasks of one kind.

    Attributes:
        function: pure, importable by name, called with one task.
        tasks: what to do.
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
    """Return `function` of every task, in the order of the tasks.

    The function must be pure. Every task runs with one linear-algebra thread, here and
    in workers: for matrices of a few hundred rows more lose time, and one thread makes
    results identical, bit by bit, for any number of workers.

    Args:
        function: importable by name, called with one task.
        tasks: what to do.
        workers: where, or just the number of processes.
        progress: called with (done, total) after every task.
        store: results of earlier runs; new ones are kept as soon as they are there.

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
    """Return the results of every batch, as of `run_tasks`.

    No core waits between one batch and the next. Progress counts all of them.
    """
    keep_memory()  # what is fitted here, beside the tasks, is quicker for it, too
    where = workers if isinstance(workers, Workers) else Workers(workers)
    indices = [
        (k, n) for k, batch in enumerate(batches) for n in range(len(batch.tasks))
    ]
    results = {} if store is None else _kept(store, batches, indices)
    if progress is not None and results:
        progress(len(results), len(indices))
    calls = [
        (_one_threaded, batches[k].function, (k, n), batches[k].tasks[n])
        for k, n in indices
        if (k, n) not in results
    ]
    with closing(_done(calls, where)) as done:  # what still runs at an error is ended
        for (k, n), result in done:
            results[k, n] = result
            if store is not None:
                store.put(batches[k].function, batches[k].tasks[n], result)
            if progress is not None:
                progress(len(results), len(indices))
    return [
        [results[k, n] for n in range(len(batch.tasks))]
        for k, batch in enumerate(batches)
    ]


def _kept(
    store: ResultStore, batches: Sequence[Batch], indices: Sequence[TaskIndex]
) -> dict[TaskIndex, Any]:
    results: dict[TaskIndex, Any] = {}
    for k, n in indices:
        result = store.get(batches[k].function, batches[k].tasks[n])
        if result is not None:
            results[k, n] = result
    return results


def _done(calls: Sequence[Call], where: Workers) -> Generator[tuple[TaskIndex, Any]]:
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
    # A library is limited only once it is loaded: SciPy brings one of its own.
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_limits

    keep_memory()
    with threadpool_limits(1):
        return index, function(task)
