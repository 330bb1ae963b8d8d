"""Audible cues for an operator with both hands on the arm: bell and speech."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum

from experiments.operator.console import Console
from experiments.settings.rig import OperatorSection


class FeedbackSignal(Enum):
    """A cue with its number of sounds and its words."""

    START = (1, "recording")
    TOO_FAST = (3, "slower")
    DONE = (2, "done")


class OperatorFeedback:
    """Gives cues through the console's bell and a speech program."""

    def __init__(
        self, console: Console, speech: SpeechOutput | None, *, has_sound: bool
    ) -> None:
        self._console = console
        self._speaker = speech
        self._has_sound = has_sound

    def give(self, cue: FeedbackSignal) -> None:
        """Give one cue; never waits."""
        sounds, words = cue.value
        if self._has_sound:
            self._console.sound(sounds)
        if self._speaker is not None:
            self._speaker.say(words)

    def close(self) -> None:
        """Stop all cues; safe to repeat."""
        if self._speaker is not None:
            self._speaker.close()


def build_feedback(settings: OperatorSection, console: Console) -> OperatorFeedback:
    """Return the cues enabled in [operator] of rig.toml."""
    program = find_speech() if settings.speech else None
    speech = SpeechOutput(program) if program is not None else None
    return OperatorFeedback(console, speech, has_sound=settings.bell)


_PROGRAMS = ("spd-say", "espeak-ng", "espeak", "say")
_PATIENCE = 0.5  # time for a killed program to end [s]


def find_speech(which: Callable[[str], str | None] = shutil.which) -> str | None:
    """Return the path of the first installed speech program, or None."""
    return next((path for name in _PROGRAMS if (path := which(name))), None)


@dataclass(slots=True)
class SpeechOutput:
    """Speaks through an external program, one phrase at a time.

    Attributes:
        program: path of the speech program.
    """

    program: str
    _speaking: subprocess.Popen[bytes] | None = field(default=None)

    def say(self, words: str) -> None:
        """Start to speak `words`, ending speech in progress.

        A program that cannot be started is ignored: speech is a convenience.
        """
        self.close()
        with suppress(OSError):
            self._speaking = _start((self.program, words))

    def close(self) -> None:
        """End speech in progress; safe to repeat."""
        speaking, self._speaking = self._speaking, None
        if speaking is not None:
            speaking.kill()
            with suppress(subprocess.TimeoutExpired):
                speaking.wait(_PATIENCE)


def _start(command: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a program in its own session: no Ctrl-C, no terminal."""
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
