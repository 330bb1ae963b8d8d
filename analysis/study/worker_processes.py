"""Worker processes for independent calls, kept alive by joblib's loky.

The only module that imports joblib. Workers end with their parent, even if it is
killed, ignore Ctrl-C, and do not run the user's script again.
"""

import os
import re
import signal
import threading
import warnings
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from importlib import import_module
from itertools import islice
from multiprocessing import active_children, resource_tracker
from multiprocessing.process import BaseProcess
from typing import Any

from acquisition.cores import available_cores
from acquisition.errors import SettingsError

Call = tuple[Callable[..., Any], *tuple[Any, ...]]  # a function and its arguments

_IDLE = 300  # s after which an idle worker ends
_LOOK = 1.0  # s between checks that the parent is alive
_EXIT_CODES = re.compile(r"exit codes of the workers are \{(.+)\}")


class WorkerLostError(SettingsError):
    """A worker process ended during a task.

    Args:
        how: signal or exit code; empty if not known.
    """

    def __init__(self, how: str = "") -> None:
        super().__init__(
            f"A process that was fitting ended unexpectedly{how and f': {how}'}.",
            hint="Run the command again: fits that were finished are kept. Where "
            "memory is short, close other programs first.",
        )


def warm_workers(modules: Sequence[str]) -> None:
    """Start workers that import modules in the background.

    Args:
        modules: modules that calls need, in order of need.
    """
    count = available_cores()
    if count > 1:
        _submit(_executor(count), [(_import, modules)] * count)


def end_workers() -> None:
    """End all workers, even during a call."""
    if processes := _processes():
        from joblib.externals.loky import get_reusable_executor

        for process in processes:  # loky's own shutdown may fail on a waiting call
            process.terminate()
        executor: Any = get_reusable_executor  # its annotations declare reuse as str
        executor(reuse=True).shutdown()


def running_workers() -> int:
    """Return the number of workers already running; 1 without any.

    Calls shorter than the start of a worker should only use these.
    """
    return max(1, len(_processes()))


def run_on_processes(calls: Iterable[Call], count: int) -> Generator[Any]:
    """Yield the results of calls as they complete.

    Args:
        calls: functions that can be imported by name, and their arguments.
        count: number of processes.

    Raises:
        WorkerLostError: a process ended in the middle of a call.
    """
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    executor, pending = _executor(count), iter(calls)
    try:
        running = _submit(executor, islice(pending, 2 * count))
        while running:
            done, running = wait(running, return_when=FIRST_COMPLETED)
            running |= _submit(executor, islice(pending, len(done)))
            yield from (future.result() for future in done)
    except TerminatedWorkerError as error:
        codes = _EXIT_CODES.search(str(error))
        raise WorkerLostError(codes[1] if codes else "") from error
    except BaseException:
        end_workers()
        raise


def _processes() -> list[BaseProcess]:
    return [p for p in active_children() if p.name.startswith("LokyProcess")]


def _executor(count: int) -> Any:  # noqa: ANN401
    from joblib.externals.loky import get_reusable_executor

    # users need no warnings about replaced or killed workers
    warnings.filterwarnings("ignore", module=r"joblib\.externals\.loky")
    with _shielded():
        return get_reusable_executor(
            count, timeout=_IDLE, initializer=_end_with, initargs=(os.getpid(),)
        )


def _submit(executor: Any, calls: Iterable[Call]) -> set[Future[Any]]:  # noqa: ANN401
    with _shielded():  # the first submission starts processes
        return {executor.submit(*call) for call in calls}


@contextmanager
def _shielded() -> Generator[None]:
    """Start processes with Ctrl-C blocked and no working folder on sys.path."""
    safe_path = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        with _no_interrupt():
            yield
    finally:
        del os.environ["PYTHONSAFEPATH"]
        if safe_path is not None:
            os.environ["PYTHONSAFEPATH"] = safe_path


@contextmanager
def _no_interrupt() -> Generator[None]:
    """Block Ctrl-C in child processes; it is delivered to this process afterwards."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # starting it later would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with(parent: int) -> None:
    """End this process when its parent ends, whatever it is doing."""

    def watch() -> None:
        while os.getppid() == parent:
            threading.Event().wait(_LOOK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _import(modules: Sequence[str]) -> None:
    for name in modules:
        import_module(name)
