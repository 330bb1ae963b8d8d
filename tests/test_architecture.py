"""The structure of the code: cycles, names, docstrings; `make contracts` has layers."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # every module is parsed

ROOT = Path(__file__).parents[1]
PACKAGES = (
    "acquisition",
    "wam",
    "ft_sensor",
    "experiments",
    "analysis",
    "fakes",
    "traction",
)


@cache
def sources() -> dict[str, Path]:
    """File of every module; a package has the name of its folder."""
    files = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            files[".".join(parts).removesuffix(".__init__")] = path
    return files


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(), str(path))


@cache
def nodes_of(path: Path) -> list[ast.AST]:
    return list(ast.walk(tree_of(path)))


def package_of(module: str) -> str:
    is_package = sources()[module].name == "__init__.py"
    return module if is_package else module.rpartition(".")[0]


def imported(module: str) -> Iterator[str]:
    """The project's own modules that `module` imports."""
    for node in nodes_of(sources()[module]):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in sources())
        elif isinstance(node, ast.ImportFrom) and node.module in sources():
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in sources() else str(node.module)


def lines_about(node: ast.ClassDef | ast.FunctionDef) -> set[str]:
    """Names that begin an entry of `Attributes:` or `Args:`."""
    docstring = ast.get_docstring(node) or ""
    sections = re.findall(
        r"^(?:Attributes|Args):\n((?:    .*\n?|\n)*)", docstring, re.M
    )
    entries = re.findall(r"^    ([\w*, ]+):(?: |$)", "".join(sections), re.M)
    return {name.strip(" *") for entry in entries for name in entry.split(",")}


def defined_names(node: ast.ClassDef | ast.FunctionDef) -> set[str]:
    """Every attribute, method and parameter that `node` defines."""
    inner = list(ast.walk(node))
    return {
        *(n.arg for n in inner if isinstance(n, ast.arg)),
        *(n.id for n in inner if isinstance(n, ast.Name)),
        *(n.attr for n in inner if isinstance(n, ast.Attribute)),
        *(n.name for n in inner if isinstance(n, ast.FunctionDef)),
    }


def test_packages_import_each_other_without_cycles():
    graph = defaultdict(set)
    for module in sources():
        for target in imported(module):
            ours, theirs = package_of(module), package_of(target)
            if ours != theirs and not ours.startswith(theirs + "."):
                graph[ours].add(theirs)
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the cycle


def test_modules_import_each_other_without_cycles_even_for_types():
    graph = {module: {*imported(module)} - {module} for module in sources()}
    TopologicalSorter(graph).prepare()


def test_a_class_name_means_one_class():
    where = defaultdict(list)
    for module, path in sources().items():
        for node in nodes_of(path):
            if isinstance(node, ast.ClassDef):
                where[node.name].append(module)
    assert {name: w for name, w in where.items() if len(w) > 1} == {}


def test_every_package_docstring_explains_the_package():
    silent = [
        name
        for name, path in sources().items()
        if path.name == "__init__.py"
        and len((ast.get_docstring(tree_of(path)) or "").split("\n")) < 2
    ]
    assert silent == []


def test_docstrings_describe_only_existing_names():
    stale = [
        f"{module}.{node.name}: {name}"
        for module, path in sources().items()
        for node in nodes_of(path)
        if isinstance(node, ast.ClassDef | ast.FunctionDef)
        for name in sorted(lines_about(node) - defined_names(node))
    ]
    assert stale == []


def test_packages_have_no_stub_files():
    assert [p for name in PACKAGES for p in (ROOT / name).rglob("*.pyi")] == []
