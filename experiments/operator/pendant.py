"""Orders to pendant and hands of a served arm, from a script and from stdin."""

from __future__ import annotations

import os
import select
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from acquisition.clock import NS_PER_S
from acquisition.errors import SettingsError
from acquisition.settings import read_text
from acquisition.simulation import Hands, PendantAction
from experiments.operator.hand_orders import (
    HAND_WORDS,
    HandOrder,
    HandOrderError,
    parse_hand_order,
)

Press = Literal["activate", "idle", "estop", "quit"]
PRESSES: tuple[Press, ...] = ("activate", "idle", "estop", "quit")
_LONGEST_LINE = 256  # bytes
_LATEST_S = 1e6
Order = Press | HandOrder
ORDERS = (*PRESSES, *HAND_WORDS)


class Pressable(Protocol):
    """Receiver of button presses, with the hands at the arm."""

    @property
    def hands(self) -> Hands | None:
        """The simulated person at the arm; None if not available."""
        ...

    def press(self, action: PendantAction) -> None:
        """Press a button now."""
        ...


@dataclass(frozen=True, slots=True)
class TimedPress:
    """A button or an order, with its time [ns after the start]."""

    after_ns: int
    press: Order


class OrderError(ValueError):
    """A line that is no command; its text states the reason."""


def parse_order(words: list[str]) -> Order:
    """Parse the words of a line as a button or an order to the hands.

    Raises:
        OrderError: they are neither.
    """
    word = words[0].lower() if len(words) == 1 else ""
    if word in PRESSES:
        return word
    try:
        order = parse_hand_order(words)
    except HandOrderError as error:
        raise OrderError(str(error)) from error
    if order is None:
        raise OrderError(f"is none of {', '.join(ORDERS)}")
    return order


def read_script(path: Path) -> tuple[TimedPress, ...]:
    """Read the script at `path`.

    Raises:
        SettingsError: `path` cannot be read, or as `parse_script`.
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
    """Parse a script into timed orders, in their sequence.

    A line is an optional time [s after the start] and a button or an order to the
    hands. Without a time it follows the previous line at once. Empty lines and
    comments with # are skipped.

    Raises:
        SettingsError: a line is malformed, or earlier than the previous one.
    """
    presses: list[TimedPress] = []
    after_ns = 0
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        try:
            timed = _parse_timed(words, after_ns)
        except OrderError as error:
            raise SettingsError(
                f"Script line {number}: {line.strip()[:60]!r} {error}.",
                hint=f"Expected [SECONDS] and one of {', '.join(ORDERS)}, "
                'e.g. "3.0 activate". Nothing was started.',
            ) from error
        after_ns = timed.after_ns
        presses.append(timed)
    return tuple(presses)


def _parse_timed(words: list[str], after_ns: int) -> TimedPress:
    """Parse a line whose time is at least `after_ns`; raises OrderError."""
    seconds = _number(words[0])
    if seconds is None:
        return TimedPress(after_ns, parse_order(words))
    if not 0 <= seconds <= _LATEST_S:
        raise OrderError(f"- expected seconds 0..{_LATEST_S:g}")
    time_ns = round(seconds * NS_PER_S)
    if time_ns < after_ns:
        raise OrderError("comes before the line above")
    if not words[1:]:
        raise OrderError("has nothing to do")
    return TimedPress(time_ns, parse_order(words[1:]))


def _number(text: str) -> float | None:
    """Parse a number; None if it is none."""
    try:
        return float(text)
    except ValueError:
        return None


class Lines:
    """Reads lines from a descriptor without blocking.

    Attributes:
        is_ended: whether the other side has closed it.
        is_terminal: whether the descriptor is a terminal.
    """

    def __init__(self, descriptor: int | None) -> None:
        """Read from `descriptor`; None = no input."""
        self.is_ended = False
        self.is_terminal = descriptor is not None and os.isatty(descriptor)
        self._descriptor = descriptor
        self._rest = b""

    def take(self) -> list[str]:
        """Return the complete lines received since the last call."""
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
        """Return whether another program has the terminal: a read would stop us."""
        if self._descriptor is None or not self.is_terminal:
            return False
        try:
            return os.tcgetpgrp(self._descriptor) != os.getpgrp()
        except OSError:  # not a controlling terminal
            return False


class Pendant:
    """Merges the orders of a script with those of a person on stdin.

    Ctrl-D on a terminal quits, unless there is a script. The end of a pipe or file does
    not: a service has no stdin and runs until a signal ends it.
    """

    def __init__(
        self, script: Iterable[TimedPress] | None, lines: Lines, start_ns: int
    ) -> None:
        self._has_script = script is not None
        self._script = list(script or ())
        self._lines = lines
        self._start_ns = start_ns
        self._unknown: list[str] = []

    def due(self, now_ns: int) -> list[Order]:
        """Return the orders due by `now_ns`, oldest first."""
        pressed: list[Order] = []
        while self._script and self._script[0].after_ns <= now_ns - self._start_ns:
            pressed.append(self._script.pop(0).press)
        for line in self._lines.take():
            try:
                pressed.append(parse_order(line.split()))
            except OrderError as error:
                self._unknown.append(f"{line.strip()[:60]!r} {error}")
        is_closed = self._lines.is_ended and self._lines.is_terminal
        if is_closed and not self._has_script:
            pressed.append("quit")
        return pressed

    def take_unknown(self) -> list[str]:
        """Return the invalid lines since the last call, with reasons."""
        unknown, self._unknown = self._unknown, []
        return unknown
