"""A step of the commissioning: its recording and its judge."""

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
        id: number of the step.
        collect: runs the step with operator and arm; returns the recording.
        judge: judges a recording; a pure function of it.
        minutes: approximate duration.
        remedy: advice after a failure.
        needs_loop: whether the loop must run; the arm need not be zeroed.
        needs_zero: whether the arm must be zeroed.
        needs_torque: whether the arm is driven freely: C0 to C11 must be valid.
    """

    id: StepId
    collect: Callable[[Scene], Values]
    judge: Callable[[Values], Judgement]
    minutes: float
    remedy: str
    needs_loop: bool = False
    needs_zero: bool = False
    needs_torque: bool = False
