"""What is asked for, and who answers without a person: keys and hand of a rehearsal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from experiments.rig.simulation import SimulationControl

REJECT_REASONS = {
    "1": "foot left the bed",
    "2": "too fast",
    "3": "touched the frame",
    "4": "sensor",
    "5": "other",
}


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
    """Answers prompts with keys: space, k, r and a digit, q; and notes with a line."""

    @property
    def draft(self) -> str:
        """What has been typed of a line so far."""
        ...

    def answer(self, asked: PromptState) -> str:
        """Return the keys pressed since the last call, "" for none."""
        ...

    def line(self, asked: PromptState) -> str | None:
        """Return the line that was typed, "" where it was given up, None before."""
        ...


class AutoOperator:
    """Presses the obvious key: space when ready, keep what is complete.

    It gives up where a person would: a rehearsal must come to an end.
    """

    draft = ""

    def answer(self, asked: PromptState) -> str:
        """Return a key as soon as it makes sense."""
        answer = _AUTOMATIC.get(asked.prompt)
        return answer(asked) if answer is not None else ""

    def line(self, asked: PromptState) -> str | None:
        """Return nothing: it never has anything to note."""
        del asked
        return ""


def _lift_key(asked: PromptState) -> str:
    return "q" if asked.since > AUTO_PATIENCE else ""


def _ready_key(asked: PromptState) -> str:
    return " " if asked.since > READY_SECONDS else ""


def _review_key(asked: PromptState) -> str:
    if asked.is_complete:
        return "k"
    return "r5" if asked.attempt < AUTO_ATTEMPTS else "q"


def _touch_key(asked: PromptState) -> str:
    """Touch a dozen points, each until the foot is at rest."""
    if asked.since < TOUCH_SECONDS:
        return ""
    return " " if asked.trial <= TOUCHES else "d"


_AUTOMATIC: dict[Prompt, Callable[[PromptState], str]] = {
    Prompt.SUPPORT: lambda _: " ",
    Prompt.CLEAR: lambda _: " ",
    Prompt.LIFT: _lift_key,
    Prompt.READY: _ready_key,
    Prompt.PAUSED: lambda _: " ",
    Prompt.TOUCH: _touch_key,
    Prompt.REVIEW: _review_key,
    Prompt.FOOT: lambda _: " ",
}


_ASIDE = frozenset({Prompt.PAUSED, Prompt.NOTE})  # the hand stays where it is


class SimulatedHand:
    """Moves the simulated hand and pendant as the prompts ask."""

    def __init__(self, simulation: SimulationControl) -> None:
        self._simulation = simulation
        self._seen: tuple[Prompt, int, int] | None = None

    def follow(self, asked: PromptState) -> None:
        """Do what a person would do at this prompt; once per prompt."""
        key = (asked.prompt, asked.trial, asked.attempt)
        if key == self._seen or asked.prompt in _ASIDE:
            return
        self._seen = key
        if asked.prompt is Prompt.SUPPORT:
            self._simulation.lift()
            self._simulation.pendant("activate")
        elif asked.prompt is Prompt.LIFT:
            self._simulation.lift()
        elif asked.prompt is Prompt.CLEAR:
            self._simulation.let_go()
        elif asked.prompt is Prompt.TOUCH:
            self._simulation.touch(asked.trial)
        elif asked.prompt is Prompt.READY:
            self._simulation.prepare(asked.trial + 1000 * (asked.attempt - 1))
            self._simulation.put_down()
        elif asked.prompt is Prompt.RECORDING:
            self._simulation.push()
        elif asked.prompt is Prompt.REVIEW:
            self._simulation.rest()
