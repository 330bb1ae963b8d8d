"""Prompts, who answers them, and the operator of a rehearsal, who is no person."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

# The automatic operator touches so many points, waits so long for the foot to rest.
TOUCHES, TOUCH_SECONDS, READY_SECONDS = 12, 9.0, 2.2
AUTO_ATTEMPTS = 8  # at one trial, before the automatic operator gives up
AUTO_PATIENCE = 60.0  # for a foot that is never lifted and still [s]


class Prompt(Enum):
    """What the person is asked for."""

    CHOICE = "choice"
    SUPPORT = "support"
    CLEAR = "clear"
    MOVING = "moving"
    TOUCH = "touch"
    LIFT = "lift"
    READY = "ready"
    PAUSED = "paused"
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


class AutoOperator:
    """Presses the obvious key: space when ready, keep what is complete.

    It gives up where a person would: a rehearsal must come to an end.
    """

    draft = ""
    who = "auto"

    def answer(self, state: PromptState) -> str:
        """Return a key as soon as it makes sense."""
        answer = _AUTOMATIC.get(state.prompt)
        return answer(state) if answer is not None else ""

    def line(self, state: PromptState) -> str | None:
        """Return nothing: it never has anything to note."""
        del state
        return ""


def _lift_key(state: PromptState) -> str:
    return "q" if state.since > AUTO_PATIENCE else ""


def _ready_key(state: PromptState) -> str:
    return " " if state.since > READY_SECONDS else ""


def _review_key(state: PromptState) -> str:
    if state.is_complete:
        return "k"
    return "r5" if state.attempt < AUTO_ATTEMPTS else "q"


def _touch_key(state: PromptState) -> str:
    """Touch a dozen points, each until the foot is at rest."""
    if state.since < TOUCH_SECONDS:
        return ""
    return " " if state.trial <= TOUCHES else "d"


_AUTOMATIC: dict[Prompt, Callable[[PromptState], str]] = {
    Prompt.SUPPORT: lambda _: " ",
    Prompt.CLEAR: lambda _: " ",
    Prompt.LIFT: _lift_key,
    Prompt.READY: _ready_key,
    Prompt.PAUSED: lambda _: " ",
    Prompt.TOUCH: _touch_key,
    Prompt.REVIEW: _review_key,
    Prompt.FOOT: lambda _: " ",
    Prompt.UNDO: lambda _: " ",
}
