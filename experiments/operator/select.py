"""Who answers the prompts: a person at the keyboard, a script, or nobody (auto)."""

import sys
from pathlib import Path

from acquisition.errors import SettingsError
from experiments.messages import CATALOGUE
from experiments.operator.prompts import AutoOperator, OperatorInput
from experiments.operator.scripted import ScriptedOperator
from experiments.operator.terminal import TerminalInput


def choose_keys(script: str | None, *, is_fake: bool) -> OperatorInput:
    """Return who answers: a script, `auto`, or the keyboard.

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
