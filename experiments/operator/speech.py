"""Spoken cues where a speech program is installed: fixed words, never waited for."""

import shutil
import subprocess
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

_PROGRAMS = ("spd-say", "espeak-ng", "espeak", "say")
_PATIENCE = 0.5  # for a program that was killed to be gone [s]


def find_speech(which: Callable[[str], str | None] = shutil.which) -> str | None:
    """Return the path of the first speech program that is installed, None for none."""
    return next((path for name in _PROGRAMS if (path := which(name))), None)


@dataclass(slots=True)
class Speaker:
    """Says words through a program of its own, one at a time.

    Attributes:
        program: path of the speech program.
    """

    program: str
    _speaking: subprocess.Popen[bytes] | None = field(default=None)

    def say(self, words: str) -> None:
        """Begin to say `words`; what is still being said is cut short.

        A program that cannot be started is passed over: nobody stops for a voice.
        """
        self.close()
        with suppress(OSError):
            self._speaking = _start((self.program, words))

    def close(self) -> None:
        """End what is being said; safe to repeat."""
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
