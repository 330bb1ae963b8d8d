"""One row of the table of borders: what is given, and what has to come of it."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import NamedTuple


class Outcome(Enum):
    """What happens to something foreign; there is nothing else."""

    READ = "read exactly"
    FLAGGED = "read exactly, flagged"
    REFUSED = "refused with cause"
    WRONG = "read wrongly"  # what no row may expect


class Answer(NamedTuple):
    """What the program made of a row.

    Attributes:
        outcome: of it.
        words: what was said.
    """

    outcome: Outcome
    words: str


@dataclass(frozen=True, slots=True)
class Border:
    """Something foreign that is given to the program.

    Attributes:
        given: what, in words.
        outcome: what has to happen.
        says: words that have to be said.
        act: gives it to the program, in an empty folder.
    """

    given: str
    outcome: Outcome
    says: str
    act: Callable[[Path], Answer]

    def __str__(self) -> str:
        return self.given
