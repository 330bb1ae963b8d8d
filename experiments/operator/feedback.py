"""What a person with both hands on the arm hears: sounds, and words where possible."""

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
    """A moment, with the number of sounds and the words for it."""

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
        """Be silent from here on; safe to repeat."""
        if self._speaker is not None:
            self._speaker.close()


def build_feedback(settings: OperatorSection, console: Console) -> OperatorFeedback:
    """Return the cues as [operator] of rig.toml wants them."""
    program = find_speech() if settings.speech else None
    speech = SpeechOutput(program) if program is not None else None
    return OperatorFeedback(console, speech, has_sound=settings.bell)


_PROGRAMS = ("spd-say", "espeak-ng", "espeak", "say")
_PATIENCE = 0.5  # for a program that was killed to be gone [s]


def find_speech(which: Callable[[str], str | None] = shutil.which) -> str | None:
    """Return the path of the first speech program that is installed, None for none."""
    return next((path for name in _PROGRAMS if (path := which(name))), None)


@dataclass(slots=True)
class SpeechOutput:
    """Says words through a program of its own, one at a time.

    Attributes:
        program: path of the speech program.
    """

    program: str
    _speaking: subprocess.Popen[bytes] | None = field(default=None)

    def say(self, words: str) -> None:
        """Begin to speak `words`; speech that is still going on is cut short.

        A program that cannot be started is passed over: speech is a convenience.
        """
        self.close()
        with suppress(OSError):
            self._speaking = _start((self.program, words))

    def close(self) -> None:
        """End the speech that is going on; safe to repeat."""
        speaking, self._speaking = self._speaking, None
        if speaking is not None:
            speaking.kill()
            with suppress(subprocess.TimeoutExpired):
                speaking.wait(_PATIENCE)


def _start(command: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a program that hears no Ctrl-C of ours and has no hold on the terminal."""
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
