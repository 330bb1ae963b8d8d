"""One row of the table of borders: an input and its expected outcome."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import NamedTuple


class Outcome(Enum):
    """Possible outcomes of an external input."""

    READ = "read exactly"
    FLAGGED = "read exactly, with a warning"
    REFUSED = "refused with a reason"
    WRONG = "read incorrectly"  # expected by no row


class Answer(NamedTuple):
    """Answer of the program to an input.

    Attributes:
        outcome: what happened to the input.
        words: text of the answer.
    """

    outcome: Outcome
    words: str


@dataclass(frozen=True, slots=True)
class Border:
    """An external input of the program.

    Attributes:
        given: description of the input.
        outcome: expected outcome.
        says: expected part of the answer.
        act: passes the input to the program, in an empty folder.
    """

    given: str
    outcome: Outcome
    says: str
    act: Callable[[Path], Answer]

    def __str__(self) -> str:
        return self.given
