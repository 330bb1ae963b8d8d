"""What becomes of an unfinished session when another run is asked for."""

from collections.abc import Sequence
from enum import Enum

from acquisition import SessionError
from experiments.messages import CATALOGUE
from experiments.operator import (
    WARNING,
    Console,
    KeyAction,
    OperatorInput,
    Prompt,
    TerminalInput,
    wait_for_key,
)
from experiments.session import UnfinishedSession


class ResumeChoice(Enum):
    """What becomes of an unfinished session."""

    RESUME = "resume"
    CLOSE = "close"


_CHOICES = {
    KeyAction.RESUME: ResumeChoice.RESUME,
    KeyAction.CLOSE: ResumeChoice.CLOSE,
}


def choose_resume(
    sessions: Sequence[UnfinishedSession],
    terrain: str,
    data: str,
    operator: OperatorInput,
    console: Console,
) -> ResumeChoice:
    """Ask what becomes of the newest unfinished session.

    Args:
        sessions: the unfinished sessions, oldest first, at least one.
        terrain: the requested one.
        data: option of a command that names the data folder, "" for none.
        operator: who answers.
        console: where it is asked.

    Raises:
        SessionError: nobody is there to ask, or the answer was [q]uit.
    """
    newest = sessions[-1]
    text = _question(newest, terrain)
    if not isinstance(operator, TerminalInput):
        raise SessionError(
            " ".join([text, *(other.text() for other in sessions[:-1])]),
            hint=f"To go on: traction resume {newest.folder.id}{data}   To close what "
            "is unfinished: the same command with --new. Nothing was started.",
        )
    name = "crash" if newest.is_crashed else "unfinished"
    name = "mismatch" if newest.folder.terrain != terrain else name
    details = {**newest.metadata(), "asked": terrain}
    console.say(f"{WARNING} {text} {CATALOGUE[name].do.format_map(details)}  [q]uit")
    action = wait_for_key(operator, Prompt.CHOICE)
    if action is KeyAction.QUIT:
        raise SessionError(text, hint="Nothing was started.")
    return _CHOICES[action]


def _question(newest: UnfinishedSession, terrain: str) -> str:
    """Return which session is unfinished, with the terrains where they differ."""
    if newest.folder.terrain == terrain:
        return newest.text()
    details = {**newest.metadata(), "asked": terrain}
    mismatch = CATALOGUE["mismatch"].what.format_map(details)
    return f"{newest.text()} {mismatch}" if newest.is_crashed else mismatch
