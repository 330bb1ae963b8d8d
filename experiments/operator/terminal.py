"""Single keys from a terminal, whose settings are always restored."""

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

_RELEASED_NS = 750_000_000  # longest time between repeats of a held key
_POLL_NS = 50_000_000  # polling period of the keyboard while no loop runs
_AT_ONCE = 256  # bytes per read
LONGEST_LINE = 500  # characters of a note
_ESCAPE, _BACKSPACE = "\x1b", "\x7f\x08"


class Cbreak:
    """Context manager: a terminal without line editing and echo.

    Leaving it twice, or through an exit handler, restores the settings once.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._before: list[int | list[bytes | int]] | None = None

    def __enter__(self) -> Self:
        """Switch the terminal over; a closed one is ignored."""
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
        """Restore the terminal."""
        del kind, error, trace
        self.restore()

    def restore(self) -> None:
        """Restore the terminal's settings; safe to repeat."""
        before, self._before = self._before, None
        if before is not None:
            atexit.unregister(self.restore)
            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, before)


def keyboard(operator: OperatorInput) -> contextlib.AbstractContextManager[object]:
    """Context manager that switches the terminal over if `operator` types there."""
    if isinstance(operator, TerminalInput):
        return Cbreak(operator.descriptor)
    return contextlib.nullcontext()


def is_person(operator: OperatorInput) -> bool:
    """Return whether `operator` is a person at a terminal."""
    return isinstance(operator, TerminalInput)


def login_name() -> str:
    """Return the login name."""
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return f"user {os.getuid()}"


def wait_for_key(operator: OperatorInput, prompt: Prompt) -> KeyAction:
    """Wait for a key of `prompt` while no loop runs; returns its action."""
    clock = SystemClock()
    state = PromptState(prompt, 0, 0, is_complete=False, since=0.0)
    with keyboard(operator):
        while (action := key_action(prompt, operator.answer(state))) is None:
            clock.sleep_until(clock.now_ns() + _POLL_NS)
        return action


class HeldKeys:
    """Distinguishes a pressed key from repeats of a held key or a stuck pedal.

    A terminal does not report releases. A held key repeats after at most 0.7 s and then
    at least ten times a second. So a key counts as pressed after a longer silence,
    whatever other keys come in between.
    """

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._last_ns: dict[str, int] = {}  # by key

    def is_pressed(self, key: str) -> bool:
        """Return whether a key just received is newly pressed."""
        now_ns = self._now_ns()
        last_ns = self._last_ns.get(key)
        self._last_ns[key] = now_ns
        return last_ns is None or now_ns - last_ns >= _RELEASED_NS


class TerminalInput:
    """Keys from a keyboard or a pedal that acts as one.

    `r` waits for the digit of the reason; any other key cancels it.

    Attributes:
        descriptor: descriptor of the terminal.
        draft: text typed of the current line.
    """

    def __init__(
        self, descriptor: int, now_ns: Callable[[], int] | None = None
    ) -> None:
        self.descriptor = descriptor
        self.draft = ""
        self._waiting: list[tuple[str, bool]] = []  # (key, newly pressed)
        self._held = HeldKeys(now_ns or SystemClock().now_ns)
        self._decoder = codecs.getincrementaldecoder("utf-8")("ignore")
        self._is_end = False
        self._is_rejecting = False
        self._prompt: Prompt | None = None

    @property
    def who(self) -> str:
        """The login name."""
        return login_name()

    def answer(self, state: PromptState) -> str:
        """Return the next key pressed, "" for none, q after the end of the input.

        Keys typed before the prompt appeared are dropped; repeats of a held key answer
        nothing.
        """
        self._receive(state.prompt)
        while self._waiting:
            is_new = self._waiting[0][1]
            key = self._next().lower()
            if is_new and (pressed := self._take(key, state.prompt)):
                return pressed
        return "q" if self._is_end else ""

    def line(self, state: PromptState) -> str | None:
        """Return the line when Enter ends it, "" when Esc cancels it, None before.

        Backspace deletes a character. Arrow keys, which begin with Esc, are ignored.
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
        """Read the pending keys; drops those typed before `prompt`."""
        self._read()
        if prompt is not self._prompt:
            self._prompt = prompt
            self._waiting.clear()
            self._is_rejecting = False
            self.draft = ""

    def _next(self) -> str:
        return self._waiting.pop(0)[0]

    def _skip_sequence(self) -> bool:
        """Skip the rest of an arrow or function key; returns whether it was one."""
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
