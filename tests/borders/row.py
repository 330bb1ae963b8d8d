"""One row of the table of borders: an input and its expected outcome."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import NamedTuple


class Outcome(Enum):
    """The possible outcomes of a foreign input."""

    READ = "read exactly"
    FLAGGED = "read exactly, flagged"
    REFUSED = "refused with cause"
    WRONG = "read wrongly"  # expected by no row


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
    """A foreign input of the program.

    Attributes:
        given: the input, in words.
        outcome: expected outcome.
        says: expected words of the answer.
        act: gives the input to the program, in an empty folder.
    """

    given: str
    outcome: Outcome
    says: str
    act: Callable[[Path], Answer]

    def __str__(self) -> str:
        return self.given
