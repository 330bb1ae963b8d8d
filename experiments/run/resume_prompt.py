"""What becomes of an unfinished session when another run is asked for."""

from collections.abc import Collection, Sequence
from enum import Enum

from acquisition.clock import SystemClock
from acquisition.errors import SessionError
from experiments.messages import CATALOGUE
from experiments.operator.console import WARNING, Console
from experiments.operator.prompts import OperatorInput, Prompt, PromptState
from experiments.operator.terminal import TerminalInput, keyboard
from experiments.session.unfinished import UnfinishedSession

_PAUSE_NS = 50_000_000  # between two looks at the keyboard


class ResumeChoice(Enum):
    """What the person wants."""

    RESUME = "resume"
    CLOSE = "close"


_KEYS = {
    "1": ResumeChoice.RESUME,
    "r": ResumeChoice.RESUME,
    "2": ResumeChoice.CLOSE,
    "n": ResumeChoice.CLOSE,
}


def choose(
    found: Sequence[UnfinishedSession],
    terrain: str,
    data: str,
    keys: OperatorInput,
    console: Console,
) -> ResumeChoice:
    """Ask what becomes of the newest unfinished session.

    Args:
        found: the unfinished sessions, oldest first, at least one.
        terrain: the one that was asked for.
        data: option of a command that names the data folder, "" for none.
        keys: who answers.
        console: where it is asked.

    Raises:
        SessionError: nobody is there to ask, or the answer was [q]uit.
    """
    newest = found[-1]
    text = _question(newest, terrain)
    if not isinstance(keys, TerminalInput):
        raise SessionError(
            " ".join([text, *(other.text() for other in found[:-1])]),
            hint=f"To go on: traction resume {newest.folder.id}{data}   To close what "
            "is unfinished: the same command with --new. Nothing was started.",
        )
    name = "crash" if newest.is_crashed else "unfinished"
    name = "mismatch" if newest.folder.terrain != terrain else name
    facts = {**newest.facts(), "asked": terrain}
    console.say(f"{WARNING} {text} {CATALOGUE[name].do.format_map(facts)}  [q]uit")
    key = ask(keys, Prompt.CHOICE, {*_KEYS, "q"})
    if key == "q":
        raise SessionError(text, hint="Nothing was started.")
    return _KEYS[key]


def ask(keys: OperatorInput, prompt: Prompt, wanted: Collection[str]) -> str:
    """Wait until one of the `wanted` keys is pressed while no loop runs; return it."""
    clock = SystemClock()
    with keyboard(keys):
        while True:
            key = keys.answer(PromptState(prompt, 0, 0, is_complete=False, since=0.0))
            if key in wanted:
                return key
            clock.sleep_until(clock.now_ns() + _PAUSE_NS)


def _question(newest: UnfinishedSession, terrain: str) -> str:
    """Return what was found, with the terrains where they differ."""
    if newest.folder.terrain == terrain:
        return newest.text()
    facts = {**newest.facts(), "asked": terrain}
    mismatch = CATALOGUE["mismatch"].what.format_map(facts)
    return f"{newest.text()} {mismatch}" if newest.is_crashed else mismatch
