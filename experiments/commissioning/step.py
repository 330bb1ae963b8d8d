"""What a step of the commissioning is: something collected, and its judge."""

from collections.abc import Callable
from dataclasses import dataclass

from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.judging import Judgement
from experiments.commissioning.recording import Values
from experiments.commissioning.scene import Scene


@dataclass(frozen=True, slots=True)
class Step:
    """One step.

    Attributes:
        id: its number.
        collect: asks for what it needs, lets the arm do it, returns what was recorded.
        judge: returns what came of a recording; it looks at nothing else.
        minutes: it takes about so long.
        remedy: what to do where it fails.
        needs_loop: the loop runs; the arm need not be zeroed.
        needs_zero: the arm is zeroed.
        needs_torque: the arm is driven in the open: steps C0 to C11 have to count.
    """

    id: StepId
    collect: Callable[[Scene], Values]
    judge: Callable[[Values], Judgement]
    minutes: float
    remedy: str
    needs_loop: bool = False
    needs_zero: bool = False
    needs_torque: bool = False
