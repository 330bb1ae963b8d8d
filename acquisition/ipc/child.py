"""Child processes of the console: start, supervision, stop; they end with it.

A child is a new interpreter that inherits three descriptors only - shared memory,
channel, a file for its standard error - and neither terminal nor process group.
"""

import ctypes
import importlib
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.control_loop.realtime import die_with_parent
from acquisition.errors import TractionError
from acquisition.ipc.channel import Channel, ChannelClosedError
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.requests import Answer, Request, ask
from acquisition.ipc.shared_memory import SharedMemory
from acquisition.linear_algebra import ONE_THREAD

_ROOT = str(Path(__file__).parents[2])
_START = (
    "import sys; sys.path.insert(0, sys.argv[1]); "
    "from acquisition.ipc.child import main; main(sys.argv[2:])"
)
_RAISED = re.compile(r"[A-Za-z_][\w.]*(Error|Exception|Interrupt)\b")
_STDERR_CHARACTERS = 4000  # characters kept of a child's standard error
ANSWER_S = 20.0  # s; a process that is silent for longer waits for a broken device
_PATIENCE = 3.0  # s for a child to end before it is killed


class ProcessLostError(TractionError):
    """A child process ended unexpectedly.

    Attributes:
        name: name of the process.
    """

    exit_code = 4

    def __init__(self, name: str, how: str, *, arm_state: str = "") -> None:
        super().__init__(
            f"The {name} process ended: {how}.",
            hint="If a .partial file is left: traction recover. Then start again.",
            arm_state=arm_state,
        )
        self.name = name


@dataclass(frozen=True, slots=True)
class ChildContext:
    """Resources of a child process.

    Attributes:
        shared: shared memory.
        channel: channel to the console.
        settings: configuration of the child.
    """

    shared: SharedLayout
    channel: Channel
    settings: Mapping[str, Any]


class Child:
    """A process that runs `module:function` with a `ChildContext`.

    Attributes:
        name: name in messages.
        channel: channel to the process.
    """

    def __init__(
        self,
        name: str,
        target: str,
        settings: Mapping[str, object],
        shared: SharedLayout,
    ) -> None:
        self.name = name
        self.channel, theirs = Channel.pair()
        self._stderr = os.memfd_create(f"traction-{name}", os.MFD_CLOEXEC)
        descriptors = (shared.memory.descriptor, theirs.fileno())
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", _START, _ROOT, target]
            + [str(descriptor) for descriptor in (*descriptors, os.getpid())],
            pass_fds=descriptors,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._stderr,
            start_new_session=True,
            # a pool of the linear algebra library would preempt the loop
            env={**os.environ, **ONE_THREAD},
        )
        theirs.close()
        self._unanswered_s = 0.0  # time after which it was killed [s]
        self.channel.send(dict(settings))

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """Whether the process is running."""
        return self._process.poll() is None

    def ask(self, request: Request[Answer], seconds: float | None = None) -> Answer:
        """Send a request to the process's `Dispatcher` and return the answer.

        Args:
            request: the request.
            seconds: time after which a process that does not answer is killed; None =
                never.

        Raises:
            TractionError: raised by the process.
            ProcessLostError: the process has ended.
        """
        try:
            return ask(self.channel, request, seconds)
        except TimeoutError:
            self._unanswered_s = seconds or 0.0
            self._process.kill()
            self.channel.close()
            raise ProcessLostError(self.name, self.exit_reason()) from None
        except ChannelClosedError:
            self._wait(_PATIENCE)
            raise ProcessLostError(self.name, self.exit_reason()) from None

    def exit_reason(self) -> str:
        """Return how the process ended: a signal, or its last error line."""
        if self._unanswered_s:
            return f"killed after {self._unanswered_s:.0f} s without an answer"
        code = self._process.poll()
        if code is not None and code < 0:
            return f"killed by {signal.Signals(-code).name}"
        error_lines = self.stderr_text().strip().splitlines()
        raised = [line for line in error_lines if _RAISED.match(line)]
        return (raised or error_lines or [f"exit code {code}"])[-1]

    def stderr_text(self) -> str:
        """Return the tail of the process's standard error."""
        size = os.fstat(self._stderr).st_size
        start = max(0, size - _STDERR_CHARACTERS)
        return os.pread(self._stderr, _STDERR_CHARACTERS, start).decode(
            errors="replace"
        )

    def stop(self) -> None:
        """Close the channel and wait for the end, kill after 3 s; idempotent."""
        self.channel.close()
        if not self._wait(_PATIENCE):
            self._process.kill()
            self._wait(_PATIENCE)  # one that waits for a broken disk does not end
        if self._stderr >= 0:
            os.close(self._stderr)
            self._stderr = -1

    def _wait(self, seconds: float) -> bool:
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        return True


def main(arguments: list[str]) -> None:
    """Entry point of a child: TARGET, memory and channel descriptors, parent's pid."""
    target, shared, channel, parent = arguments
    die_with_parent(signal.SIGTERM)
    if os.getppid() != int(parent):
        return  # the parent died before die_with_parent
    module, function = target.split(":")
    run: Callable[[ChildContext], None] = getattr(
        importlib.import_module(module), function
    )
    link = Channel.adopt(int(channel))
    layout = SharedLayout(SharedMemory(int(shared)))
    layout.memory.touch()
    try:
        settings = link.receive()
        run(ChildContext(layout, link, settings))
    except ChannelClosedError:
        return  # the console has gone; the process with the arm has idled it


def name_process(name: str) -> None:
    """Set the name of this process in process lists (15 characters)."""
    pr_set_name = 15
    ctypes.CDLL(None, use_errno=True).prctl(pr_set_name, name.encode()[:15], 0, 0, 0)
