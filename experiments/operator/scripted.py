"""A scripted operator: one line of a file for every key worth mentioning."""

from pathlib import Path

from acquisition.errors import SettingsError
from experiments.operator.prompts import (
    READY_SECONDS,
    REJECT_REASONS,
    AutoOperator,
    Prompt,
    PromptState,
)

# word of a line: the key it presses
_BEFORE = {"pause": "p", "note": "n", "view": "v", "last": "q"}  # between trials
_AFTER = {"keep": "k", "quit": "q", "remark": "n", "redo": "r"}  # at the review
_TOLD = frozenset({"note", "remark"})  # a text follows
_KEYS = {Prompt.READY: _BEFORE, Prompt.REVIEW: _AFTER}
_LARGEST = 1_000_000  # bytes; a script has a few hundred


class ScriptedOperator:
    """Presses keys line by line, each at its own prompt; the rest like AutoKeys.

    At a review: `keep`, `redo REASON` (1-5), `remark TEXT` (a note on the trial),
    `quit`. Between trials, before the next one begins: `pause`, `note TEXT`, `view`,
    `last` (quit after the next trial). `#` begins a comment. After the last line
    everything that is complete is kept.

    Raises:
        SettingsError: the file cannot be read or a line is none of these.
    """

    draft = ""

    def __init__(self, path: Path) -> None:
        self._auto = AutoOperator()
        lines = enumerate(_read(path).splitlines(), 1)
        bare = [(number, line.split("#")[0].split()) for number, line in lines]
        self._lines = [_parse(path, number, words) for number, words in bare if words]
        self._text = ""

    def answer(self, asked: PromptState) -> str:
        """Return the key of the next line where it is its turn."""
        keys = _KEYS.get(asked.prompt, {})
        word, rest = self._lines[0] if self._lines else ("", "")
        if word not in keys:
            return self._auto.answer(asked)
        if asked.prompt is Prompt.READY and asked.since <= READY_SECONDS:
            return ""
        self._lines.pop(0)
        self._text = rest
        return keys[word] + (rest if word == "redo" else "")

    def line(self, asked: PromptState) -> str | None:
        """Return the text of the line that asked for the note."""
        del asked
        return self._text


def _read(path: Path) -> str:
    try:
        if path.stat().st_size > _LARGEST:
            raise ValueError("it is too large")
        return path.read_text()
    except (OSError, ValueError) as error:
        raise SettingsError(
            f"The operator script {path} cannot be read.",
            hint="Name a text file or auto. Nothing was started.",
        ) from error


def _parse(path: Path, number: int, words: list[str]) -> tuple[str, str]:
    word, rest = words[0], " ".join(words[1:])
    if word in _TOLD and rest:
        return word, rest
    if word == "redo" and rest in REJECT_REASONS:
        return word, rest
    if word in {**_BEFORE, **_AFTER} and word not in {"redo", *_TOLD} and not rest:
        return word, rest
    raise SettingsError(
        f"{path}, line {number}: {' '.join(words)!r} - expected keep, redo 1..5 or "
        "quit; remark TEXT; or between trials pause, note TEXT, view or last.",
        hint="Nothing was started.",
    )
