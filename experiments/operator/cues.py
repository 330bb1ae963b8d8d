"""What a person with both hands on the arm hears: bells, and words where possible."""

from __future__ import annotations

from enum import Enum

from experiments.operator.console import Console
from experiments.operator.speech import Speaker, find_speech
from experiments.settings.rig import OperatorSection


class Cue(Enum):
    """A moment, with the number of bells and the words for it."""

    START = (1, "recording")
    TOO_FAST = (3, "slower")
    DONE = (2, "done")


class Cues:
    """Gives cues through the console's bell and a speech program."""

    def __init__(
        self, console: Console, speaker: Speaker | None, *, rings: bool
    ) -> None:
        self._console = console
        self._speaker = speaker
        self._rings = rings

    def give(self, cue: Cue) -> None:
        """Give one cue; never waits."""
        bells, words = cue.value
        if self._rings:
            self._console.bell(bells)
        if self._speaker is not None:
            self._speaker.say(words)

    def close(self) -> None:
        """Be silent from here on; safe to repeat."""
        if self._speaker is not None:
            self._speaker.close()


def build_cues(settings: OperatorSection, console: Console) -> Cues:
    """Return the cues as [operator] of rig.toml wants them."""
    program = find_speech() if settings.speech else None
    speaker = Speaker(program) if program is not None else None
    return Cues(console, speaker, rings=settings.bell)
