"""The automatic operator of a rehearsal, who is no person."""

from __future__ import annotations

from collections.abc import Callable

from acquisition.simulation import ENDS
from experiments.operator.prompts import Prompt, PromptState

DAMPED_SECONDS = 0.5  # after a fault of motion, until it lets the arm hold again [s]
LAID_DOWN_SECONDS = 1.0  # until it has the arm, before that goes idle [s]
TOUCHES = 12  # points that are touched
TOUCH_SECONDS = 9.0  # until the foot is at rest on a point [s]
READY_SECONDS = 2.2  # until it is at rest before a trial [s]
AUTO_ATTEMPTS = 8  # at one trial, before it gives up
AUTO_PATIENCE = 60.0  # for a foot that is never lifted and still [s]


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
    return "d" if TOUCHES < state.trial <= ENDS else " "


_AUTOMATIC: dict[Prompt, Callable[[PromptState], str]] = {
    Prompt.SUPPORT: lambda _: " ",
    Prompt.CONFIRM: lambda _: " ",
    Prompt.MOVE: lambda _: "g",
    Prompt.LIFT: _lift_key,
    Prompt.READY: _ready_key,
    Prompt.PAUSED: lambda _: " ",
    Prompt.LAY_DOWN: lambda state: "i" if state.since > LAID_DOWN_SECONDS else "",
    Prompt.DAMPED: lambda state: " " if state.since > DAMPED_SECONDS else "",
    Prompt.TOUCH: _touch_key,
    Prompt.REVIEW: _review_key,
    Prompt.FOOT: lambda _: " ",
    Prompt.UNDO: lambda _: " ",
}
