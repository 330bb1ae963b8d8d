"""Names that are looked up only when a slow test or a benchmark runs.

What a test replaces in a module, what a script in a string imports, and the keywords a
call uses: each must exist, or a missed rename is noticed hours later.
"""

import ast
import importlib
import inspect
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # every module of tests is parsed

ROOT = Path(__file__).parents[1]
FOLDERS = ("tests", "benchmarks")
OURS = {
    *("acquisition", "wam", "ft_sensor", "experiments", "analysis", "fakes"),
    *("traction", "lab", *FOLDERS),
}
IMPORT = re.compile(r"^\s*from ([\w.]+) import ([\w, ]+)$", re.MULTILINE)
FILES = sorted(p for folder in FOLDERS for p in (ROOT / folder).rglob("*.py"))
MISSING = object()
Nodes = list[ast.AST]


@cache
def resolved(path: str) -> object:
    """The object that a dotted path names, `MISSING` for none."""
    parts = path.split(".")
    for length in range(len(parts), 0, -1):
        try:
            thing = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError as error:
            if (error.name or "").split(".")[0] not in OURS:
                pytest.skip(f"{error.name} is not installed")
            continue
        for name in parts[length:]:
            thing = getattr(thing, name, MISSING)
        return thing
    return MISSING


def aliases(nodes: Nodes) -> dict[str, str]:
    """Dotted path of every name of the project that a file imports."""
    paths = {}
    for node in nodes:
        if isinstance(node, ast.Import):
            paths |= {a.asname or a.name: a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            for a in node.names:
                paths[a.asname or a.name] = f"{node.module}.{a.name}"
    return {name: p for name, p in paths.items() if p.split(".")[0] in OURS}


def calls(nodes: Nodes) -> Iterator[ast.Call]:
    return (node for node in nodes if isinstance(node, ast.Call))


def dotted(node: ast.expr) -> str:
    """Dotted name of an expression, such as `a.b.c`; empty for no name."""
    if isinstance(node, ast.Name):
        return node.id
    inner = dotted(node.value) if isinstance(node, ast.Attribute) else ""
    return f"{inner}.{node.attr}" if inner else ""


def replaced(nodes: Nodes) -> Iterator[str]:
    """Dotted path of everything that is replaced for a test."""
    paths = aliases(nodes)
    for call in calls(nodes):
        if not (isinstance(call.func, ast.Attribute) and call.func.attr == "setattr"):
            continue
        first, *others = call.args
        if isinstance(first, ast.Constant) and isinstance(first.value, str):
            yield first.value
        elif others and isinstance(others[0], ast.Constant) and dotted(first) in paths:
            yield f"{paths[dotted(first)]}.{others[0].value}"


def imported_in_strings(nodes: Nodes) -> Iterator[str]:
    """Dotted path of everything that scripts in strings import."""
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            for module, names in IMPORT.findall(node.value):
                yield from (f"{module}.{n.split()[0]}" for n in names.split(","))


def keywords(nodes: Nodes) -> Iterator[tuple[str, str]]:
    """(dotted path, keyword) of calls of what a file imports."""
    paths = aliases(nodes)
    for call in calls(nodes):
        if (path := paths.get(dotted(call.func))) is not None:
            yield from ((path, word.arg) for word in call.keywords if word.arg)


def takes(path: str, keyword: str) -> bool:
    """Whether the object that `path` names can be called with `keyword`."""
    thing = resolved(path)
    if not callable(thing):
        return False
    parameters = inspect.signature(thing).parameters.values()
    return any(
        p.name == keyword or p.kind is inspect.Parameter.VAR_KEYWORD for p in parameters
    )


@pytest.mark.parametrize("file", FILES, ids=lambda f: str(f.relative_to(ROOT)))
def test_names_that_a_file_looks_up_late_exist(file):
    nodes = list(ast.walk(ast.parse(file.read_text())))
    late = [*replaced(nodes), *imported_in_strings(nodes)]
    ours = [path for path in late if path.split(".")[0] in OURS]
    assert [path for path in ours if resolved(path) is MISSING] == []
    asked = set(keywords(nodes))
    assert sorted(f"{p}({k}=)" for p, k in asked if not takes(p, k)) == []
