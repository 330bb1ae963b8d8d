"""Commands run by a scenario: to their end, or interactively with keys."""

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
_READ_SIZE = 65536  # bytes
_POLL_INTERVAL = 0.05  # s


class ScenarioError(Exception):
    """A scenario failed; the message gives the reason."""


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
    """A process with a terminal as its stdin, whose output is read.

    Attributes:
        output: all output so far.
        log: log of the scenario; the output is appended for the report of a failure.
    """

    def __init__(
        self,
        command: Sequence[str],
        log: list[str],
        *,
        run: Run | None = None,
    ) -> None:
        """Start `command`; `run` is the equivalent function for a warm start."""
        self.output = ""
        self.log = log
        self._searched = 0  # characters of the output that `expect` has passed
        self._keys, line = pty.openpty()
        # Keys are delivered one by one, not by line.
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
        """Whether the process has not ended."""
        return self._process.poll() is None

    def press(self, keys: str) -> None:
        """Type keys."""
        self.log.append(f"[keys {keys!r}]\n")
        os.write(self._keys, keys.encode())

    def expect(self, text: str, patience: float) -> str:
        """Wait for `text`; return the output since the last call, up to its end.

        Raises:
            ScenarioError: no such output within `patience` [s], or the process ended.
        """
        end = seconds() + patience
        while True:
            index = self.output.find(text, self._searched)
            if index >= 0:
                before, self._searched = self._searched, index + len(text)
                return self.output[before : self._searched]
            is_over = not self.is_running
            self._read(_POLL_INTERVAL)
            if is_over and text not in self.output[self._searched :]:
                code = self._process.returncode
                raise ScenarioError(f"ended with {code} before printing {text!r}")
            if seconds() > end and text not in self.output[self._searched :]:
                raise ScenarioError(f"did not print {text!r} within {patience:g} s")

    def run_on(self, duration: float) -> None:
        """Let the process run for a while [s], reading its output."""
        end = seconds() + duration
        while (left := end - seconds()) > 0:
            self._read(min(left, _POLL_INTERVAL))

    def wait(self, patience: float) -> int:
        """Wait for the end of the process; return its exit code.

        Raises:
            ScenarioError: it did not end within `patience` [s] and was killed.
        """
        end = seconds() + patience
        while self.is_running:
            self._read(_POLL_INTERVAL)
            if seconds() > end:
                self.close()
                raise ScenarioError(f"did not end within {patience:g} s")
        self._read(0.0)
        return self._process.returncode

    def close(self) -> None:
        """Kill the process and its children if they still run; safe to repeat."""
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
            while data := os.read(self._out, _READ_SIZE):
                text = data.decode(errors="replace")
                self.output += text
                self.log.append(text)
            # At the end of the file, select always returns at once.
            if self.is_running:
                wait(min(_POLL_INTERVAL, patience))


class Shell:
    """Runs system commands to their end.

    Attributes:
        log: commands and their output.
    """

    def __init__(self, log: list[str]) -> None:
        self.log = log

    def run(self, line: str, *, is_checked: bool = True) -> str:
        """Run a command line without quoting; return its output.

        Raises:
            ScenarioError: the command failed.
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
    """Return the text of a small kernel file, surrounding white space removed."""
    return path.read_text(encoding="ascii", errors="replace").strip()
