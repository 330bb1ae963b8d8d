"""Independent tasks on cores or on a cluster; the only module that imports dask."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from ipaddress import ip_address
from itertools import islice
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable
from urllib.parse import urlsplit

from acquisition.errors import MissingLibraryError, SettingsError
from acquisition.linear_algebra import keep_memory
from acquisition.worker_processes import (
    WorkerLostError,
    available_cores,
    prepare_workers,
    read_shared,
    run_calls,
    running_workers,
    shared_file,
)

Task = TypeVar("Task")
Result = TypeVar("Result")
Progress = Callable[[int, int], None]

_FEW = 3  # tasks that cost less than starting workers
_FITTING = ("analysis.study.terrain_fit", "analysis.study.store")  # imports of workers
_PATIENCE = 10.0  # s to reach a scheduler
# Dask warns of calls of 10 MB and more; the trials of a terrain may be larger
_LARGE_TASKS = {"distributed.admin.large-graph-warning-threshold": "1GB"}


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
        if self.n_jobs is None and tasks <= _FEW:
            return min(running_workers(), tasks)
        return min(available_cores() if self.n_jobs is None else self.n_jobs, tasks)


@runtime_checkable
class SharedTasks(Protocol):
    """Tasks that are made from one body of data: it is shared once, then its numbers.

    What is pickled of it goes to every worker a single time: its arrays by a file that
    all of them map, or scattered on a cluster.
    """

    def outline(self, index: int) -> object:
        """Return what tells one task from every other, without its data."""
        ...


@dataclass(frozen=True, slots=True)
class Batch:
    """Tasks of one kind.

    Attributes:
        function: pure, importable by name, called with one task.
        tasks: what to do.
    """

    function: Callable[[Any], Any]
    tasks: Sequence[Any]


TaskIndex = tuple[int, int]  # of a task: number of its batch, and in it


class Store(Protocol):
    """Keeps results, so that an interrupted study resumes."""

    def get(self, function: Callable[..., Any], task: Any) -> Any | None:  # noqa: ANN401
        """Return what the function made of a task before, None if nothing is kept."""
        ...

    def put(self, function: Callable[..., Any], task: Any, result: Any) -> None:  # noqa: ANN401
        """Keep what the function made of a task."""
        ...


def run_tasks(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    workers: Workers | int | None = None,
    progress: Progress | None = None,
    store: Store | None = None,
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
        MissingLibraryError: Dask is not installed.
    """
    (results,) = run_batches([Batch(function, tasks)], workers, progress, store)
    return results


def run_batches(
    batches: Sequence[Batch],
    workers: Workers | int | None = None,
    progress: Progress | None = None,
    store: Store | None = None,
) -> list[list[Any]]:
    """Return the results of every batch, as of `run_tasks`.

    No core waits between one batch and the next. Progress counts all of them.

    Raises:
        SettingsError: the scheduler does not answer, or is reached without TLS.
    """
    keep_memory()  # what is fitted here, beside the tasks, is quicker for it, too
    where = workers if isinstance(workers, Workers) else Workers(workers)
    indices = [
        (k, n) for k, batch in enumerate(batches) for n in range(len(batch.tasks))
    ]
    results = {} if store is None else _stored(store, batches, indices)
    left = [index for index in indices if index not in results]
    if progress is not None and results:
        progress(len(results), len(indices))
    for (k, n), result in _stream(batches, left, where):
        results[k, n] = result
        if store is not None:
            store.put(batches[k].function, _key(batches[k].tasks, n), result)
        if progress is not None:
            progress(len(results), len(indices))
    return [
        [results[k, n] for n in range(len(batch.tasks))]
        for k, batch in enumerate(batches)
    ]


def _key(tasks: Sequence[Any], number: int) -> object:
    """Return what a store knows a task by."""
    return tasks.outline(number) if isinstance(tasks, SharedTasks) else tasks[number]


def _stored(
    store: Store, batches: Sequence[Batch], indices: Sequence[TaskIndex]
) -> dict[TaskIndex, Any]:
    results: dict[TaskIndex, Any] = {}
    for k, n in indices:
        result = store.get(batches[k].function, _key(batches[k].tasks, n))
        if result is not None:
            results[k, n] = result
    return results


def _stream(
    batches: Sequence[Batch], left: Sequence[TaskIndex], where: Workers
) -> Iterator[tuple[TaskIndex, Any]]:
    """Yield (index, result) of every task left as it is done, in any order."""
    count = where.count(len(left))
    if not left:
        return
    if where.scheduler is not None:
        yield from _on_cluster(where.scheduler, batches, left)
    elif count <= 1:
        yield from (
            _one_threaded(batches[k].function, (k, n), batches[k].tasks[n])
            for k, n in left
        )
    else:
        shared = _shared(batches)
        with shared_file(shared) if shared else nullcontext() as file:
            files = dict.fromkeys(shared, file)
            prepare_workers(_FITTING)
            yield from run_calls(_calls(batches, left, _read_and_taken, files), count)


def _shared(batches: Sequence[Batch]) -> dict[int, Sequence[Any]]:
    """Return the tasks that are shared, by the number of their batch."""
    every = enumerate(batch.tasks for batch in batches)
    return {k: tasks for k, tasks in every if isinstance(tasks, SharedTasks)}


def _calls(
    batches: Sequence[Batch],
    left: Sequence[TaskIndex],
    taking: Callable[..., Any],
    shared: Mapping[int, Any],
) -> list[Any]:
    """Return what to call for every task left, and with what.

    `taking` finds a shared task in what `shared` has for its batch.
    """
    return [
        (taking, batches[k].function, (k, n), shared[k])
        if k in shared
        else (_one_threaded, batches[k].function, (k, n), batches[k].tasks[n])
        for k, n in left
    ]


def _read_and_taken(
    function: Callable[[Any], Any], index: TaskIndex, file: Path
) -> tuple[TaskIndex, Any]:
    return _taken(function, index, read_shared(file)[index[0]])


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


def is_guarded(address: str) -> bool:
    """Return whether nobody can answer in the place of the scheduler at `address`.

    Dask carries pickled objects: who can write into the connection can execute
    anything here. It has to be authenticated by TLS, or stay on this machine.
    """
    scheme, _, netloc = address.rpartition("://")
    if scheme not in {"", "tcp", "tls"}:
        return False
    try:
        host = urlsplit(f"//{netloc}").hostname or ""
        is_loopback = host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        is_loopback = False
    return scheme == "tls" or is_loopback


def _on_cluster(
    address: str, batches: Sequence[Batch], left: Sequence[TaskIndex]
) -> Iterator[Any]:
    """Yield (index, result) from the Dask scheduler at `address`.

    Tasks that are shared go to every worker once, from one to the next; what is asked
    for then is their numbers, several at a time as long as many are left.
    """
    try:
        from dask.config import set as configured
        from distributed import KilledWorker, as_completed
    except ImportError as error:
        raise MissingLibraryError("distributed", "cluster") from error

    shared = _shared(batches)
    with _client(address) as client, configured(_LARGE_TASKS):
        held = {
            k: client.scatter([tasks], broadcast=True, hash=False)[0]
            for k, tasks in shared.items()
        }
        calls = iter(_calls(batches, left, _taken, held))
        sizes = guided_sizes(len(left), sum(client.nthreads().values()))
        asked = [
            client.submit(_in_turn, list(islice(calls, size)), pure=False)
            for size in sizes
        ]
        try:
            for _, results in as_completed(asked, loop=client.loop, with_results=True):
                yield from results
        except KilledWorker as error:
            raise WorkerLostError from error


def guided_sizes(count: int, workers: int) -> list[int]:
    """Return in how many tasks at a time so many are handed out.

    Half of an equal share as long as many are left, one by one at the end: few calls,
    and no worker waits long for another (Polychronopoulos and Kuck 1987).
    """
    sizes: list[int] = []
    while count:
        sizes.append(max(1, count // (2 * max(workers, 1))))
        count -= sizes[-1]
    return sizes


def _in_turn(calls: Sequence[Any]) -> list[tuple[TaskIndex, Any]]:
    return [call(*arguments) for call, *arguments in calls]


def _taken(
    function: Callable[[Any], Any], index: TaskIndex, tasks: Sequence[Any]
) -> tuple[TaskIndex, Any]:
    return _one_threaded(function, index, tasks[index[1]])


def _client(address: str) -> Any:  # noqa: ANN401
    """Return a connection to the Dask scheduler at `address`."""
    from distributed import Client

    if not is_guarded(address):
        raise SettingsError(
            f"The Dask scheduler {address} is neither on this machine nor reached by "
            "TLS.",
            hint="What comes back from it is executed here. Name tls://HOST:PORT with "
            "certificates in Dask's configuration, or leave --scheduler out.",
        )
    try:
        return Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SettingsError(
            f"No Dask scheduler answers at {address} within {_PATIENCE:.0f} s.",
            hint="Start one with `dask scheduler` and workers with `dask worker`, or "
            "leave --scheduler out.",
        ) from error
