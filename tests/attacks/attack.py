"""One row of an attack: what is done to the program, when, and what must hold."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path


class RunBy(StrEnum):
    """The command that runs a row; each one runs the rows of those before it, too."""

    TEST = "make test"
    CI = ".ci/run"
    NIGHTLY = ".ci/nightly"


@dataclass(frozen=True, slots=True)
class Attack:
    """One row.

    Attributes:
        done: what is done, in the words of an engineer of the arm.
        when: the phase, delay, place or seeds.
        holds: what must hold afterwards.
        check: attacks in an empty folder; raises `AssertionError` if the claim does
            not hold.
        run_by: the first command that runs it.
        seconds: longest time on a busy machine [s].
        on_wall_clock: starts processes; nothing else may run meanwhile.
    """

    done: str
    when: str
    holds: str
    check: Callable[[Path], None]
    run_by: RunBy = RunBy.TEST
    seconds: float = 60.0
    on_wall_clock: bool = False

    def __str__(self) -> str:
        return f"{self.done}, {self.when}" if self.when else self.done
