"""Processes that begin with their libraries loaded: forked, in place of executed.

An interpreter that loads numpy, Pinocchio and the program takes the emulated processor
ten seconds of the host's time, and every command starts four of them. A forked one does
the same with what the runner of the scenarios has loaded before. Streams, signals,
descriptors and environment are those of a fresh process; nothing else is shared.
"""

import gc
import os
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

Run = Callable[[], object]
_HIGHEST = 1024  # descriptor
_UNTOUCHABLE = {signal.SIGKILL, signal.SIGSTOP}
_IGNORED = {signal.SIGPIPE, signal.SIGXFSZ}  # by every interpreter
_GENERATIONS = (700, 10, 10)  # of the garbage collector, as at its start
_CHILD = (sys.executable, "-P", "-c")  # how the program starts its processes


def in_place_of(
    command: Sequence[str], run: Run, kept: Collection[int] = ()
) -> Callable[[], None]:
    """Return what a new process does in place of executing a command; it never returns.

    Args:
        command: what `sys.argv` becomes.
        run: what the command does.
        kept: descriptors that stay open beside the streams.
    """

    def become() -> None:
        code = 1
        try:
            _make_fresh(kept)
            sys.argv = list(command)
            run()
            code = 0
        except SystemExit as end:
            code = exit_code(end)
        except BaseException:
            traceback.print_exc()
        finally:
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
            os._exit(code)

    return become


def exit_code(end: SystemExit) -> int:
    """Return the exit code of a process, a text written to stderr."""
    if end.code is None or isinstance(end.code, int):
        return end.code or 0
    sys.stderr.write(f"{end.code}\n")
    return 1


def _make_fresh(kept: Collection[int]) -> None:
    """Leave nothing of the parent but the modules that it has loaded."""
    gc.freeze()  # what the parent had is not collected, and closed, here
    gc.enable()
    gc.set_threshold(*_GENERATIONS)
    for number in signal.valid_signals() - _UNTOUCHABLE:
        signal.signal(number, _first_handler(number))
    low = 3
    for descriptor in (*sorted(kept), _HIGHEST):
        os.closerange(low, descriptor)  # also what tells the parent of an exec
        low = descriptor + 1
    sys.stdin = os.fdopen(0, "r", closefd=False)
    sys.stdout = os.fdopen(1, "w", closefd=False)
    sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)
    start_warm()


def start_warm() -> None:
    """Let what this process starts of the program begin warm."""
    subprocess.Popen = WarmPopen  # pyright: ignore[reportAttributeAccessIssue]


def _first_handler(number: int) -> Any:  # noqa: ANN401 - as the library has it
    if number == signal.SIGINT:
        return signal.default_int_handler
    return signal.SIG_IGN if number in _IGNORED else signal.SIG_DFL


_Popen = subprocess.Popen[Any]


class WarmPopen(_Popen):
    """As `subprocess.Popen`; the program's own processes are forked."""

    def __init__(self, args: Sequence[str], **options: Any) -> None:  # noqa: ANN401
        if tuple(args[: len(_CHILD)]) == _CHILD:
            options = _forked(args, options)
        super().__init__(args, **options)


def _forked(args: Sequence[str], options: Mapping[str, Any]) -> dict[str, Any]:
    text, *operands = args[len(_CHILD) :]
    environment: Mapping[str, str] = options.get("env") or {}

    def run() -> None:
        os.environ.update(environment)
        exec(compile(text, "<string>", "exec"), {"__name__": "__main__"})

    kept: Collection[int] = options.get("pass_fds", ())
    become = in_place_of(["-c", *operands], run, kept)
    return {**options, "preexec_fn": become}
