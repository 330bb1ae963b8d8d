"""Processes that start with their libraries loaded: forked instead of executed.

Loading numpy, Pinocchio and the program takes an interpreter in the emulator ten
seconds of the host's time, and every command starts four interpreters. A forked process
inherits the modules loaded by the scenario runner; its streams, signals, descriptors
and environment are those of a new process.
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
_MAX_DESCRIPTOR = 1024
_UNTOUCHABLE = {signal.SIGKILL, signal.SIGSTOP}
_IGNORED = {signal.SIGPIPE, signal.SIGXFSZ}  # by every new interpreter
_GENERATIONS = (700, 10, 10)  # default thresholds of the garbage collector
_CHILD = (sys.executable, "-P", "-c")  # the program's command for its own processes


def in_place_of(
    command: Sequence[str], run: Run, kept: Collection[int] = ()
) -> Callable[[], None]:
    """Return a function for a new process that replaces a command; it never returns.

    Args:
        command: the new `sys.argv`.
        run: function equivalent to the command.
        kept: descriptors that stay open in addition to the streams.
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
    """Return the exit code of SystemExit; a text is written to stderr."""
    if end.code is None or isinstance(end.code, int):
        return end.code or 0
    sys.stderr.write(f"{end.code}\n")
    return 1


def _make_fresh(kept: Collection[int]) -> None:
    """Reset all state inherited from the parent except its loaded modules."""
    gc.freeze()  # the parent's objects must not be collected, and closed, here
    gc.enable()
    gc.set_threshold(*_GENERATIONS)
    for number in signal.valid_signals() - _UNTOUCHABLE:
        signal.signal(number, _first_handler(number))
    low = 3
    for descriptor in (*sorted(kept), _MAX_DESCRIPTOR):
        os.closerange(low, descriptor)  # also signals the parent, as an exec would
        low = descriptor + 1
    sys.stdin = os.fdopen(0, "r", closefd=False)
    sys.stdout = os.fdopen(1, "w", closefd=False)
    sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)
    start_warm()


def start_warm() -> None:
    """Make later starts of the program's processes in this process warm."""
    subprocess.Popen = WarmPopen  # pyright: ignore[reportAttributeAccessIssue]


def _first_handler(number: int) -> Any:  # noqa: ANN401 - as the library has it
    if number == signal.SIGINT:
        return signal.default_int_handler
    return signal.SIG_IGN if number in _IGNORED else signal.SIG_DFL


_Popen = subprocess.Popen[Any]


class WarmPopen(_Popen):
    """`subprocess.Popen` that forks the program's own processes."""

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
