"""Choice of the operator: a person at the keyboard, a script, or automatic."""

import sys
from pathlib import Path

from acquisition.errors import SettingsError
from acquisition.settings import read_text
from experiments.messages import CATALOGUE
from experiments.operator.auto_operator import READY_SECONDS, AutoOperator
from experiments.operator.keys import REJECT_REASONS, Operand, script_keys
from experiments.operator.prompts import OperatorInput, Prompt, PromptState
from experiments.operator.terminal import TerminalInput

_PROMPTS = (Prompt.LIFT, Prompt.READY, Prompt.REVIEW)
_WORDS = {word: key for prompt in _PROMPTS for word, key in script_keys(prompt).items()}
NO_PERSONS = frozenset({AutoOperator.who, "script"})  # automatic operators


def choose_operator(script: str | None, *, is_fake: bool) -> OperatorInput:
    """Return the operator: a script, `auto`, or the keyboard.

    Raises:
        SettingsError: a real session without a terminal, or a bad script.
    """
    stdin = sys.stdin
    has_person = stdin is not None and stdin.isatty()
    if script == "auto" or (script is None and is_fake and not has_person):
        return AutoOperator()
    if script is not None:
        return ScriptedOperator(Path(script))
    if stdin is None or not has_person:
        message = CATALOGUE["nobody"]
        raise SettingsError(message.what, hint=message.do)
    return TerminalInput(stdin.fileno())


class ScriptedOperator:
    """Presses the keys of a script, each at its prompt; otherwise as `AutoOperator`.

    At a review: `keep`, `redo REASON` (1-5), `remark TEXT` (a note on the trial),
    `quit`. Between trials: `pause`, `note TEXT`, `view`, `last` (quit after the next
    trial), `undo` (of the previous verdict). `#` begins a comment. After the last line
    every complete trial is kept.

    Raises:
        SettingsError: the file cannot be read, or a line is invalid.
    """

    draft = ""
    who = "script"  # one of NO_PERSONS

    def __init__(self, path: Path) -> None:
        self._auto = AutoOperator()
        lines = enumerate(_read(path).splitlines(), 1)
        bare = [(number, line.split("#")[0].split()) for number, line in lines]
        self._lines = [_parse(path, number, words) for number, words in bare if words]
        self._text = ""

    def answer(self, state: PromptState) -> str:
        """Return the key of the next line if this is its prompt."""
        keys = script_keys(state.prompt)
        word, argument = self._lines[0] if self._lines else ("", "")
        if word not in keys:
            return self._auto.answer(state)
        if state.prompt is Prompt.READY and state.since <= READY_SECONDS:
            return ""
        self._lines.pop(0)
        self._text = argument
        entry = keys[word]
        return entry.key + (argument if entry.operand is Operand.REASON else "")

    def line(self, state: PromptState) -> str | None:
        """Return the text of the note in the script."""
        del state
        return self._text


def _read(path: Path) -> str:
    try:
        return read_text(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingsError(
            f"The operator script {path} cannot be read ({reason}).",
            hint="Name a text file or auto. Nothing was started.",
        ) from error


def _parse(path: Path, number: int, words: list[str]) -> tuple[str, str]:
    word, argument = words[0], " ".join(words[1:])
    if word in _WORDS and _is_operand(_WORDS[word].operand, argument):
        return word, argument
    raise SettingsError(
        f"{path}, line {number}: {' '.join(words)!r} - expected keep, redo 1..5 or "
        "quit; remark TEXT; or between trials pause, note TEXT, view, last or undo.",
        hint="Nothing was started.",
    )


def _is_operand(operand: Operand, text: str) -> bool:
    if operand is Operand.REASON:
        return text in REJECT_REASONS
    return bool(text) is (operand is Operand.TEXT)
