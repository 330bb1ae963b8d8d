"""Single keys from a terminal, which is given back as it was whatever happens."""

import atexit
import contextlib
import os
import select
import termios
import tty
from types import TracebackType
from typing import Self

from experiments.operator import REJECT_REASONS, Asked, Keys, Prompt

_AT_ONCE = 256  # bytes


class Cbreak:
    """A terminal without line editing and echo while this lasts.

    Leaving it twice, or through an exit handler, restores the same settings once.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._before: list[int | list[bytes | int]] | None = None

    def __enter__(self) -> Self:
        """Switch the terminal over; one that has gone is left alone."""
        with contextlib.suppress(termios.error):
            self._before = termios.tcgetattr(self._descriptor)
            tty.setcbreak(self._descriptor, termios.TCSADRAIN)
            atexit.register(self.restore)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Give the terminal back."""
        del kind, error, trace
        self.restore()

    def restore(self) -> None:
        """Give the terminal back as it was; a second call does nothing."""
        before, self._before = self._before, None
        if before is not None:
            atexit.unregister(self.restore)
            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, before)


def keyboard(keys: Keys) -> contextlib.AbstractContextManager[object]:
    """Return what switches the terminal over while `keys` come from it."""
    if isinstance(keys, TerminalKeys):
        return Cbreak(keys.descriptor)
    return contextlib.nullcontext()


class TerminalKeys:
    """Keys as they are pressed, from a keyboard or anything that looks like one.

    A pedal that types a space or a letter is a keyboard too. `r` waits for the digit
    of the reason; any other key takes the `r` back.

    Attributes:
        descriptor: of the terminal.
    """

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self._waiting = ""
        self._is_end = False
        self._is_rejecting = False
        self._prompt: Prompt | None = None

    def answer(self, asked: Asked) -> str:
        """Return the next key that was pressed, "" for none, q when all have gone.

        What was typed before the prompt came was not meant for it and is forgotten.
        """
        self._read()
        if asked.prompt is not self._prompt:
            self._prompt = asked.prompt
            self._waiting, self._is_rejecting = "", False
        while self._waiting:
            key, self._waiting = self._waiting[0], self._waiting[1:]
            found = self._take(key.lower(), asked.prompt)
            if found:
                return found
        return "q" if self._is_end else ""

    def _read(self) -> None:
        while not self._is_end and select.select([self.descriptor], [], [], 0)[0]:
            try:
                data = os.read(self.descriptor, _AT_ONCE)
            except OSError:
                data = b""
            self._is_end = not data
            self._waiting += data.decode(errors="ignore")

    def _take(self, key: str, prompt: Prompt) -> str:
        if key in "\r\n":
            key = " "  # Enter confirms like space
        if self._is_rejecting:
            self._is_rejecting = False
            return f"r{key}" if key in REJECT_REASONS else ""
        if key == "r" and prompt is Prompt.REVIEW:
            self._is_rejecting = True
            return ""
        return key if key.isprintable() else ""
