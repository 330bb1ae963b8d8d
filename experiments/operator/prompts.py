"""Prompts to the operator, and the interface that answers them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol


class Prompt(Enum):
    """Prompt to the operator."""

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
    """A prompt with its context.

    Attributes:
        prompt: the prompt.
        trial: number of the trial.
        attempt: number of the attempt, from 1.
        is_complete: REVIEW only: whether the trial is complete.
        since: time since the prompt appeared [s].
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
        """Text typed of the current line."""
        ...

    @property
    def who(self) -> str:
        """Name of the operator in the records of a session without --operator."""
        ...

    def answer(self, state: PromptState) -> str:
        """Return the keys pressed since the last call, "" for none."""
        ...

    def line(self, state: PromptState) -> str | None:
        """Return the line once typed, "" if cancelled, None before."""
        ...
