"""Sentences of all refusals in analysis.logs, read from their source."""

import ast
from collections.abc import Iterator
from pathlib import Path

import analysis.logs

REFUSING = {"SettingsError", "damaged", "_refused", "MessageError", "DamageError"}
LOGS = Path(analysis.logs.__path__[0])


def template(node: ast.expr) -> str:
    """Return a sentence with {} for each value."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        parts = (
            template(p) if isinstance(p, ast.Constant) else "{}" for p in node.values
        )
        return "".join(parts)
    if isinstance(node, ast.IfExp):
        return f"{template(node.body)}|{template(node.orelse)}"
    return "{}"


def sentences() -> Iterator[tuple[str, str]]:
    """Yield (module, sentence) of every refusal."""
    for path in sorted(LOGS.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
                continue
            if node.func.id not in REFUSING or not node.args:
                continue
            is_of_path = node.func.id in {"damaged", "_refused"}
            sentence = template(node.args[1] if is_of_path else node.args[0])
            yield path.stem, sentence.removeprefix("{}: ")
