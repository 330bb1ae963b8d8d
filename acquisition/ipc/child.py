"""Processes beside the console: spawned, watched, stopped; they die with it.

A child is a new interpreter that inherits three descriptors - shared memory, channel,
a file for its standard error - and nothing else: no terminal, no signals of its group.
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
_STDERR_CHARACTERS = 4000  # characters of a child's standard error
_PATIENCE = 3.0  # s a child gets to end by itself


class ProcessLostError(TractionError):
    """A process beside the console ended unasked.

    Attributes:
        name: which one.
    """

    exit_code = 4

    def __init__(self, name: str, how: str, *, arm_state: str = "") -> None:
        super().__init__(
            f"The {name} process ended: {how}.",
            hint="A .partial file: traction recover. Then start again.",
            arm_state=arm_state,
        )
        self.name = name


@dataclass(frozen=True, slots=True)
class ChildContext:
    """What a child process gets at its start.

    Attributes:
        shared: the shared memory.
        channel: to the console.
        settings: its configuration.
    """

    shared: SharedLayout
    channel: Channel
    settings: Mapping[str, Any]


class Child:
    """A process that runs `module:function` with a `ChildContext`.

    Attributes:
        name: what it is called in messages.
        channel: to it.
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
        self.channel.send(dict(settings))

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """Whether it runs."""
        return self._process.poll() is None

    def ask(self, request: Request[Answer]) -> Answer:
        """Return the answer of its `Dispatcher` to a request.

        Raises:
            TractionError: what it raised.
            ProcessLostError: it has ended.
        """
        try:
            return ask(self.channel, request)
        except ChannelClosedError:
            self._wait(_PATIENCE)
            raise ProcessLostError(self.name, self.how_it_ended()) from None

    def how_it_ended(self) -> str:
        """Return how it ended, in words: a signal, or the last line it wrote."""
        code = self._process.poll()
        if code is not None and code < 0:
            return f"killed by {signal.Signals(-code).name}"
        words = self.stderr_text().strip().splitlines()
        raised = [line for line in words if _RAISED.match(line)]
        return (raised or words or [f"exit code {code}"])[-1]

    def stderr_text(self) -> str:
        """Return the end of what it wrote to its standard error."""
        size = os.fstat(self._stderr).st_size
        start = max(0, size - _STDERR_CHARACTERS)
        return os.pread(self._stderr, _STDERR_CHARACTERS, start).decode(
            errors="replace"
        )

    def stop(self) -> None:
        """Hang up and wait until it ends; after 3 s it is killed. Safe to repeat."""
        self.channel.close()
        if not self._wait(_PATIENCE):
            self._process.kill()
            self._process.wait()
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
    """Run one child: TARGET, descriptors of memory and channel, pid of the parent."""
    target, shared, channel, parent = arguments
    die_with_parent(signal.SIGTERM)
    if os.getppid() != int(parent):
        return  # it died before the line above
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
    """Call this process `name` (15 characters) where processes are listed."""
    pr_set_name = 15
    ctypes.CDLL(None, use_errno=True).prctl(pr_set_name, name.encode()[:15], 0, 0, 0)
