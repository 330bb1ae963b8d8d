"""Processes for independent tasks: copies of one that has imported what they need.

That one is the fork server of `multiprocessing`. It is started early and imports while
its parent reads data; a worker is there milliseconds after it is asked for, and what
all of them import is read and held once. Fork servers have a single thread, so that a
copy of one is sound whatever the parent does. Where there are none, a worker is a new
interpreter.
"""

import copyreg
import multiprocessing
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from functools import lru_cache
from itertools import islice
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from types import ModuleType
from typing import Any

from acquisition.errors import SettingsError
from acquisition.linear_algebra import openblas_settings
from acquisition.temporary_folders import temporary_folder

_METHOD = "forkserver"
_ROOT = str(Path(__file__).parents[1])

Call = tuple[Callable[..., Any], *tuple[Any, ...]]  # a function and its arguments


class WorkerLostError(SettingsError):
    """A process that worked on a task is gone: ended from outside."""

    def __init__(self) -> None:
        super().__init__(
            "A process that was fitting was ended from outside, as the system does "
            "where memory runs out.",
            hint="Close other programs and run the command again: fits that were "
            "finished are kept.",
        )


def available_cores() -> int:
    """Return the number of cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def prepare_workers(imports: Sequence[str]) -> None:
    """Start what workers are copied from; the first call counts.

    Args:
        imports: modules that tasks need, the first needed first.
    """
    if _METHOD not in multiprocessing.get_all_start_methods():
        return
    multiprocessing.get_context(_METHOD).set_forkserver_preload(list(imports))
    resource_tracker.ensure_running()  # it would unblock signals below
    with _environment_of_workers(), _no_interrupt():
        forkserver.ensure_running()


class WorkerPool:
    """Processes that run calls until they are ended, or this process is.

    Args:
        size: number of processes.
    """

    def __init__(self, size: int) -> None:
        known = multiprocessing.get_all_start_methods()
        context = multiprocessing.get_context(_METHOD if _METHOD in known else "spawn")
        ends, self._held_open = context.Pipe(duplex=False)
        self.size = size
        self._executor = ProcessPoolExecutor(size, context, _begin, (ends,))

    def run(self, calls: Sequence[Call], at_once: int) -> Iterator[Any]:
        """Yield what calls return, as soon as each is done.

        A pool whose calls are not run to their end is ended.

        Args:
            calls: functions that can be imported by name, and their arguments.
            at_once: number of processes to use.

        Raises:
            WorkerLostError: a process was ended from outside.
        """
        left = iter(calls)
        ahead = len(calls) if at_once >= self.size else at_once
        done: SimpleQueue[Future[Any]] = SimpleQueue()
        try:
            self._submit(islice(left, ahead), done)
            for _ in calls:
                future = done.get()
                self._submit(islice(left, 1), done)
                yield future.result()
        except BrokenExecutor as error:
            self.end()
            raise WorkerLostError from error
        except BaseException:
            self.end()
            raise

    def end(self) -> None:
        """End the processes, whatever they do. Safe to repeat."""
        self._held_open.close()
        self._executor.shutdown(cancel_futures=True)

    def _submit(self, calls: Iterator[Call], done: "SimpleQueue[Future[Any]]") -> None:
        try:
            with _without_main():
                for call in calls:
                    self._executor.submit(*call).add_done_callback(done.put)
        except (EOFError, ConnectionError) as error:
            raise BrokenExecutor("no process could be started") from error


_pools: list[WorkerPool] = []  # the one of earlier calls, if it is there


def running_workers() -> int:
    """Return how many processes earlier calls have started; 1 where there are none.

    Tasks that take less time than starting them are worth giving to these only.
    """
    return min(max([1, *(pool.size for pool in _pools)]), available_cores())


def run_calls(calls: Sequence[Call], at_once: int) -> Iterator[Any]:
    """Yield what calls return, as soon as each is done.

    The processes wait for the next calls.

    Args:
        calls: functions that can be imported by name, and their arguments.
        at_once: number of processes.

    Raises:
        WorkerLostError: a process was ended from outside.
    """
    pool = _pools.pop() if _pools else WorkerPool(at_once)
    if pool.size < at_once:
        pool.end()
        pool = WorkerPool(at_once)
    yield from pool.run(calls, at_once)
    _pools.append(pool)


@contextmanager
def shared_file(value: object) -> Generator[Path]:
    """Give a file that holds a value for the workers; at the end it is removed."""
    from joblib import dump

    with temporary_folder("traction-tasks", Path(tempfile.gettempdir())) as folder:
        path = folder / "shared"
        dump(value, path)
        yield path


@lru_cache(maxsize=1)
def read_shared(path: Path) -> Any:  # noqa: ANN401
    """Return the value of a `shared_file`; its arrays are mapped, not read."""
    from joblib import load

    _allow_files()
    return load(path, mmap_mode="r")


def _allow_files() -> None:
    """Let this process open as many files as the system grants it.

    Every array that is mapped takes one: a study of two sessions more than the 1024
    that most systems begin with.
    """
    with suppress(ImportError, OSError, ValueError):
        import resource  # only Unix has it

        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _begin(ends: Connection) -> None:
    """Let this process end with its parent, and by nobody's Ctrl-C."""
    import numpy as np

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # what was mapped is sent as what it holds
    copyreg.pickle(np.memmap, lambda array: np.asarray(array).__reduce__())
    threading.Thread(target=_end_with, args=(ends,), daemon=True).start()


def _end_with(ends: Connection) -> None:
    """End this process as soon as nobody holds the other end open."""
    with suppress(EOFError, OSError):
        ends.recv_bytes()
    os._exit(1)


@contextmanager
def _environment_of_workers() -> Generator[None]:
    """Let a new interpreter find this code, and no module of the working folder."""
    before = dict(os.environ)
    paths = (_ROOT, os.environ.get("PYTHONPATH", ""))
    os.environ.update(openblas_settings() | before)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@contextmanager
def _no_interrupt() -> Generator[None]:
    """Let what is started be deaf to Ctrl-C; it reaches this process afterwards."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _without_main() -> Generator[None]:
    """Let no process run the parent's script again: tasks need none of its names.

    A module that was started by its name stays: it is written to be imported, too.
    """
    main = sys.modules["__main__"]
    if getattr(main, "__spec__", None) is not None:
        yield
        return
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
