"""Commands that a scenario runs: to their end, or with a person at the keyboard."""

import contextlib
import os
import pty
import select
import signal
import subprocess
import termios
from collections.abc import Sequence
from pathlib import Path

from acquisition.clock import NS_PER_S, SystemClock
from lab.guest.warm_start import Run, in_place_of

CLOCK = SystemClock()
_AT_ONCE = 65536
_SLICE = 0.05  # s between two looks


class ScenarioError(Exception):
    """A scenario did not come out as its name says."""


def seconds() -> float:
    """Return the guest's monotonic time [s]."""
    return CLOCK.now_ns() / NS_PER_S


def wait(duration: float) -> None:
    """Wait [s of guest time]."""
    CLOCK.sleep_until(CLOCK.now_ns() + int(duration * NS_PER_S))


def require(is_met: bool, text: str) -> None:
    """Raise ScenarioError with `text` unless a condition holds."""
    if not is_met:
        raise ScenarioError(text)


class Program:
    """A process whose output is read, and which has a terminal as its stdin.

    Attributes:
        output: everything it wrote so far.
        log: where the same is appended for the report of a failure.
    """

    def __init__(
        self,
        command: Sequence[str],
        log: list[str],
        *,
        run: Run | None = None,
    ) -> None:
        """Start `command`; `run`: the same as a function, for a warm start."""
        self.output = ""
        self.log = log
        self._seen = 0
        self._keys, line = pty.openpty()
        # Keys are taken as they come, not by line.
        attributes = termios.tcgetattr(line)
        attributes[3] &= ~(termios.ECHO | termios.ICANON)
        termios.tcsetattr(line, termios.TCSANOW, attributes)
        log.append(f"$ {' '.join(command)}\n")
        self._process = subprocess.Popen(
            command,
            stdin=line,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=run and in_place_of(command, run),  # noqa: PLW1509 - no threads here
        )
        os.close(line)
        assert self._process.stdout is not None
        self._out = self._process.stdout.fileno()
        os.set_blocking(self._out, False)

    @property
    def is_running(self) -> bool:
        """Whether it has not ended."""
        return self._process.poll() is None

    def press(self, keys: str) -> None:
        """Type keys."""
        self.log.append(f"[keys {keys!r}]\n")
        os.write(self._keys, keys.encode())

    def expect(self, text: str, patience: float) -> str:
        """Return the output up to and with `text`, read on from the last such call.

        Raises:
            ScenarioError: it did not come within `patience` [s], or the process ended.
        """
        end = seconds() + patience
        while True:
            index = self.output.find(text, self._seen)
            if index >= 0:
                before, self._seen = self._seen, index + len(text)
                return self.output[before : self._seen]
            is_over = not self.is_running
            self._read(_SLICE)
            if is_over and text not in self.output[self._seen :]:
                code = self._process.returncode
                raise ScenarioError(f"ended with {code} before it said {text!r}")
            if seconds() > end and text not in self.output[self._seen :]:
                raise ScenarioError(f"did not say {text!r} within {patience:g} s")

    def run_on(self, duration: float) -> None:
        """Let it run for a while [s], reading what it says."""
        end = seconds() + duration
        while (left := end - seconds()) > 0:
            self._read(min(left, _SLICE))

    def wait(self, patience: float) -> int:
        """Return its exit code.

        Raises:
            ScenarioError: it does not end within `patience` [s]; it is killed.
        """
        end = seconds() + patience
        while self.is_running:
            self._read(_SLICE)
            if seconds() > end:
                self.close()
                raise ScenarioError(f"did not end within {patience:g} s")
        self._read(0.0)
        return self._process.returncode

    def close(self) -> None:
        """End it and all it has started, if it still runs; safe to repeat."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        if self._keys >= 0:
            self._read(0.0)
            os.close(self._keys)
            self._keys = -1

    def _read(self, patience: float) -> None:
        if not select.select([self._out], [], [], patience)[0]:
            return
        with contextlib.suppress(BlockingIOError):
            while data := os.read(self._out, _AT_ONCE):
                text = data.decode(errors="replace")
                self.output += text
                self.log.append(text)
            # At the end of the file select returns at once for ever.
            if self.is_running:
                wait(min(_SLICE, patience))


class Shell:
    """Runs commands of the system to their end.

    Attributes:
        log: commands and their output.
    """

    def __init__(self, log: list[str]) -> None:
        self.log = log

    def run(self, line: str, *, is_checked: bool = True) -> str:
        """Return the output of a command line without quoting.

        Raises:
            ScenarioError: it failed.
        """
        done = subprocess.run(
            line.split(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        self.log.append(f"$ {line}\n{done.stdout}")
        if is_checked and done.returncode:
            raise ScenarioError(f"{line!r} failed: {done.stdout.strip()}")
        return done.stdout


def read_text(path: Path) -> str:
    """Return a small file of the kernel without its last newline."""
    return path.read_text(encoding="ascii", errors="replace").strip()
