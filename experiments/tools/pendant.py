"""The pendant of a served network: lines of a script and of stdin that press it."""

from __future__ import annotations

import math
import os
import select
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from acquisition.clock import NS_PER_S
from acquisition.errors import SettingsError
from acquisition.settings import read_text

Press = Literal["activate", "idle", "estop", "quit"]
PendantButton = Literal["activate", "idle", "estop"]
PRESSES: tuple[Press, ...] = ("activate", "idle", "estop", "quit")
_LONGEST_LINE = 256  # bytes; what is longer is no button
_LATEST_S = 1e6


class Pressable(Protocol):
    """A pendant's other end."""

    def press(self, action: PendantButton) -> None:
        """Press a button now."""
        ...


@dataclass(frozen=True, slots=True)
class TimedPress:
    """A button, and when it is pressed [ns after the start]."""

    after_ns: int
    press: Press


def parse_press(text: str) -> Press | None:
    """Return the button that a line names, None if it names none."""
    word = text.strip().lower()
    return word if word in PRESSES else None


def read_script(path: Path) -> tuple[TimedPress, ...]:
    """Return the presses of the script at `path`.

    Raises:
        SettingsError: it cannot be read, or as `parse_script`.
    """
    try:
        text = read_text(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingsError(
            f"--script {path} cannot be read: {reason}.", hint="Nothing was started."
        ) from error
    return parse_script(text)


def parse_script(text: str) -> tuple[TimedPress, ...]:
    """Return the presses of a script, in the order in which they come.

    A line is a button, or a time [s after the start] and a button; a line without a
    time follows the one before it at once. Empty lines and those with # are skipped.

    Raises:
        SettingsError: a line is neither, or its time lies before the line above.
    """
    presses: list[TimedPress] = []
    after_ns = 0
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        press = parse_press(words[-1])
        time_ns = _parse_time(words[0]) if len(words) == 2 else after_ns
        if press is None or len(words) > 2 or time_ns is None or time_ns < after_ns:
            raise SettingsError(
                f"Script line {number}: {line.strip()[:60]!r} is not a press in order.",
                hint=f'Expected [SECONDS] {"|".join(PRESSES)}, e.g. "3.0 activate".',
            )
        after_ns = time_ns
        presses.append(TimedPress(after_ns, press))
    return tuple(presses)


def _parse_time(text: str) -> int | None:
    try:
        seconds = float(text)
    except ValueError:
        return None
    if not (math.isfinite(seconds) and 0 <= seconds <= _LATEST_S):
        return None
    return round(seconds * NS_PER_S)


class Lines:
    """Splits what comes from a descriptor into lines, without waiting.

    Attributes:
        is_ended: the other side has closed it.
        is_terminal: a person is on the other side.
    """

    def __init__(self, descriptor: int | None) -> None:
        """Read from `descriptor`; None is one that never says anything."""
        self.is_ended = False
        self.is_terminal = descriptor is not None and os.isatty(descriptor)
        self._descriptor = descriptor
        self._rest = b""

    def take(self) -> list[str]:
        """Return the whole lines that have arrived since the last call."""
        if self._descriptor is None or self.is_ended or self._is_in_background():
            return []
        if not select.select([self._descriptor], [], [], 0)[0]:
            return []
        chunk = os.read(self._descriptor, 4096)
        self.is_ended = not chunk
        *lines, rest = (self._rest + (chunk or b"\n")).split(b"\n")
        self._rest = rest[:_LONGEST_LINE]
        return [line.decode(errors="replace") for line in lines if line.strip()]

    def _is_in_background(self) -> bool:
        """Return whether another program has the terminal: reading would stop us."""
        if self._descriptor is None or not self.is_terminal:
            return False
        try:
            return os.tcgetpgrp(self._descriptor) != os.getpgrp()
        except OSError:  # a terminal that controls nobody
            return False


class Pendant:
    """Presses buttons as a script and a person on stdin say.

    Ctrl-D on a terminal quits, unless there is a script. The end of a pipe or a file
    does not: a service has no stdin, and goes on until a signal ends it.
    """

    def __init__(
        self, script: Iterable[TimedPress] | None, lines: Lines, start_ns: int
    ) -> None:
        self._has_script = script is not None
        self._script = list(script or ())
        self._lines = lines
        self._start_ns = start_ns
        self._unknown: list[str] = []

    def due(self, now_ns: int) -> list[Press]:
        """Return what is pressed by `now_ns`, oldest first."""
        pressed: list[Press] = []
        while self._script and self._script[0].after_ns <= now_ns - self._start_ns:
            pressed.append(self._script.pop(0).press)
        for line in self._lines.take():
            if (press := parse_press(line)) is None:
                self._unknown.append(line)
            else:
                pressed.append(press)
        is_left = self._lines.is_ended and self._lines.is_terminal
        if is_left and not self._has_script:
            pressed.append("quit")
        return pressed

    def take_unknown(self) -> list[str]:
        """Return the lines that named no button since the last call."""
        unknown, self._unknown = self._unknown, []
        return unknown
