"""What the operator is asked for, and the interface of whoever answers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol


class Prompt(Enum):
    """What the person is asked for."""

    CHOICE = "choice"
    SUPPORT = "support"
    CONFIRM = "confirm"
    MOVE = "move"
    MOVING = "moving"
    TOUCH = "touch"
    LIFT = "lift"
    READY = "ready"
    PAUSED = "paused"
    DAMPED = "damped"
    LAY_DOWN = "lay down"
    RECORDING = "recording"
    REVIEW = "review"
    NOTE = "note"
    FOOT = "foot"
    UNDO = "undo"


@dataclass(frozen=True, slots=True)
class PromptState:
    """A prompt with what it is about.

    Attributes:
        prompt: what is asked for.
        trial: number of the trial.
        attempt: which attempt at it, from 1.
        is_complete: REVIEW only: the trial ended by itself.
        since: how long it has been asked [s].
    """

    prompt: Prompt
    trial: int
    attempt: int
    is_complete: bool
    since: float


class OperatorInput(Protocol):
    """Answers prompts with keys of `operator.keys`, and notes with a line."""

    @property
    def draft(self) -> str:
        """What has been typed of a line so far."""
        ...

    @property
    def who(self) -> str:
        """Who presses the keys, in the records of a session without --operator."""
        ...

    def answer(self, state: PromptState) -> str:
        """Return the keys pressed since the last call, "" for none."""
        ...

    def line(self, state: PromptState) -> str | None:
        """Return the line that was typed, "" where it was given up, None before."""
        ...
