"""The automatic operator of a rehearsal."""

from __future__ import annotations

from collections.abc import Callable

from acquisition.simulation import ENDS
from experiments.operator.prompts import Prompt, PromptState

DAMPED_SECONDS = 0.5  # from a motion fault until it lets the arm hold again [s]
LAID_DOWN_SECONDS = 1.0  # until it supports the arm, which then goes idle [s]
TOUCHES = 12  # points to touch
TOUCH_SECONDS = 9.0  # until the foot rests on a point [s]
READY_SECONDS = 2.2  # until the foot rests before a trial [s]
AUTO_ATTEMPTS = 8  # attempts at one trial before it gives up
AUTO_PATIENCE = 60.0  # time-out for a foot to be lifted and still [s]


class AutoOperator:
    """Presses the obvious key: space when ready, keep for a complete trial.

    Gives up where a person would, so that a rehearsal comes to an end.
    """

    draft = ""
    who = "auto"

    def answer(self, state: PromptState) -> str:
        """Return the obvious key of the prompt, after a realistic delay."""
        answer = _AUTOMATIC.get(state.prompt)
        return answer(state) if answer is not None else ""

    def line(self, state: PromptState) -> str | None:
        """Return an empty note."""
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
    """Touch a dozen points, each until the foot rests."""
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
