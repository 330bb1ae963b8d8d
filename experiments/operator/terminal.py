"""Single keys from a terminal, which is given back as it was whatever happens."""

import atexit
import codecs
import contextlib
import os
import pwd
import select
import termios
import tty
from collections.abc import Callable
from types import TracebackType
from typing import Self

from acquisition.clock import SystemClock
from experiments.operator.keys import (
    REJECT_REASONS,
    KeyAction,
    awaits_reason,
    key_action,
)
from experiments.operator.prompts import OperatorInput, Prompt, PromptState

_RELEASED_NS = 750_000_000  # without a key that would repeat if it were held
_POLL_NS = 50_000_000  # between two looks at the keyboard while no loop runs
_AT_ONCE = 256  # bytes
LONGEST_LINE = 500  # characters of a note
_ESCAPE, _BACKSPACE = "\x1b", "\x7f\x08"


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


def keyboard(operator: OperatorInput) -> contextlib.AbstractContextManager[object]:
    """Return what switches the terminal over while `operator` types there."""
    if isinstance(operator, TerminalInput):
        return Cbreak(operator.descriptor)
    return contextlib.nullcontext()


def is_person(operator: OperatorInput) -> bool:
    """Return whether `operator` types at a terminal, and may take any time."""
    return isinstance(operator, TerminalInput)


def login_name() -> str:
    """Return the name of the person who is logged in."""
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return f"user {os.getuid()}"


def wait_for_key(operator: OperatorInput, prompt: Prompt) -> KeyAction:
    """Wait for a key of `prompt` while no loop runs; return what it does."""
    clock = SystemClock()
    state = PromptState(prompt, 0, 0, is_complete=False, since=0.0)
    with keyboard(operator):
        while (action := key_action(prompt, operator.answer(state))) is None:
            clock.sleep_until(clock.now_ns() + _POLL_NS)
        return action


class HeldKeys:
    """Tells a key that is pressed from one that repeats: held, or a pedal that sticks.

    A terminal does not tell when a key is released. One that is held comes again after
    at most 0.7 s and then at least ten times a second. So each key counts once it has
    been silent for longer, whatever other keys come between.
    """

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._last_ns: dict[str, int] = {}  # by key

    def is_pressed(self, key: str) -> bool:
        """Return whether a key that has just come is pressed anew."""
        now_ns = self._now_ns()
        last_ns = self._last_ns.get(key)
        self._last_ns[key] = now_ns
        return last_ns is None or now_ns - last_ns >= _RELEASED_NS


class TerminalInput:
    """Keys as they are pressed, from a keyboard or anything that looks like one.

    A pedal that types a space or a letter is a keyboard too. `r` waits for the digit
    of the reason; any other key takes the `r` back.

    Attributes:
        descriptor: of the terminal.
        draft: what has been typed of a line so far.
    """

    def __init__(
        self, descriptor: int, now_ns: Callable[[], int] | None = None
    ) -> None:
        self.descriptor = descriptor
        self.draft = ""
        self._waiting: list[tuple[str, bool]] = []  # (key, it was pressed anew)
        self._held = HeldKeys(now_ns or SystemClock().now_ns)
        self._decoder = codecs.getincrementaldecoder("utf-8")("ignore")
        self._is_end = False
        self._is_rejecting = False
        self._prompt: Prompt | None = None

    @property
    def who(self) -> str:
        """The person who is logged in."""
        return login_name()

    def answer(self, state: PromptState) -> str:
        """Return the next key that was pressed, "" for none, q when all have gone.

        What was typed before the prompt came was not meant for it and is forgotten. A
        key that only repeats, because it is held, answers nothing.
        """
        self._receive(state.prompt)
        while self._waiting:
            is_anew = self._waiting[0][1]
            key = self._next().lower()
            if is_anew and (pressed := self._take(key, state.prompt)):
                return pressed
        return "q" if self._is_end else ""

    def line(self, state: PromptState) -> str | None:
        """Return the line when Enter ends it, "" when Esc cancels it, None before.

        Backspace takes a character back. An arrow key, which begins like Esc, does
        nothing.
        """
        self._receive(state.prompt)
        while self._waiting:
            key = self._next()
            if key in "\r\n":
                pressed, self.draft = self.draft, ""
                return pressed
            if key == _ESCAPE and not self._skip_sequence():
                self.draft = ""
                return ""
            if key in _BACKSPACE:
                self.draft = self.draft[:-1]
            elif key.isprintable() and len(self.draft) < LONGEST_LINE:
                self.draft += key
        return "" if self._is_end else None

    def _receive(self, prompt: Prompt) -> None:
        """Read what is there; what came before `prompt` is forgotten."""
        self._read()
        if prompt is not self._prompt:
            self._prompt = prompt
            self._waiting.clear()
            self._is_rejecting = False
            self.draft = ""

    def _next(self) -> str:
        return self._waiting.pop(0)[0]

    def _skip_sequence(self) -> bool:
        """Pass over the rest of an arrow or function key; return whether it was one."""
        if not self._waiting or self._waiting[0][0] not in ("[", "O"):
            return False
        self._next()
        while self._waiting and not (key := self._next()).isalpha() and key != "~":
            pass
        return True

    def _read(self) -> None:
        while not self._is_end and select.select([self.descriptor], [], [], 0)[0]:
            try:
                data = os.read(self.descriptor, _AT_ONCE)
            except OSError:
                data = b""
            self._is_end = not data
            for key in self._decoder.decode(data):
                self._waiting.append((key, self._held.is_pressed(key)))

    def _take(self, key: str, prompt: Prompt) -> str:
        if key in "\r\n":
            key = " "  # Enter confirms like space
        if self._is_rejecting:
            self._is_rejecting = False
            return f"r{key}" if key in REJECT_REASONS else ""
        if awaits_reason(prompt, key):
            self._is_rejecting = True
            return ""
        return key if key.isprintable() else ""
