"""Measures the structure of the code: `python -m tests.architecture`.

Imports are followed to the module that defines a name, through the public surfaces of
packages (`__init__.pyi`), so that a surface hides no dependency from these numbers.
"""

import ast
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = (
    *("acquisition", "wam", "ft_sensor", "experiments", "analysis", "fakes"),
    "traction",
)
MOST_COMMANDS, MOST_MODULES = 20, 15
LONGEST_CHAIN = 9
MOST_SERVING_ONE = 59
LONGEST_MODULE, LONGEST_CLASS, LONGEST_FUNCTION = 300, 250, 50  # lines
MOST_PARAMETERS = 6
# Public by their documentation: os, namedtuple, python-can.
DOCUMENTED = frozenset({"_exit", "_replace", "_asdict", "_recv_internal"})

Imports = dict[str, set[str]]


@dataclass(frozen=True, slots=True)
class Measure:
    """One property of the structure.

    Attributes:
        name: what is measured.
        value: what was found.
        limit: the largest value that is accepted.
        where: the places that count, the worst first.
    """

    name: str
    value: int
    limit: int
    where: tuple[str, ...] = ()

    @property
    def is_met(self) -> bool:
        return self.value <= self.limit


@lru_cache
def sources() -> Mapping[str, Path]:
    """Return the file of every module; a package has the name of its folder."""
    files = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            files[".".join(parts).removesuffix(".__init__")] = path
    return files


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(), str(path))


def is_package(module: str) -> bool:
    return sources()[module].name == "__init__.py"


def package_of(module: str) -> str:
    return module if is_package(module) else module.rpartition(".")[0]


@lru_cache
def surface(package: str) -> Mapping[str, str]:
    """Return every public name of a package and the module that defines it."""
    stub = sources()[package].with_suffix(".pyi")
    if not stub.exists():
        return {}
    names = {}
    for node in tree_of(stub).body:
        if isinstance(node, ast.ImportFrom):
            module = f"{package}.{node.module}" if node.module else package
            for alias in node.names:
                own = f"{package}.{alias.name}"
                names[alias.name] = own if own in sources() else module
    return names


def imported(module: str) -> Iterator[tuple[str, str]]:
    """Yield (module as written, name) of every import of the project's own code."""
    for node in ast.walk(tree_of(sources()[module])):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, alias.name) for alias in node.names)


def defining(written: str, name: str) -> str | None:
    """Return the module that `from written import name` reaches, None if not ours."""
    if f"{written}.{name}" in sources():
        return f"{written}.{name}"
    if written not in sources():
        return None
    return surface(written).get(name, written)


@lru_cache
def dependencies() -> Mapping[str, frozenset[str]]:
    """Return which modules each module imports, followed through the surfaces."""
    found = {}
    for module in sources():
        targets = {defining(written, name) for written, name in imported(module)}
        found[module] = frozenset(t for t in targets if t and t != module)
    return found


def around_surfaces() -> list[str]:
    """Return imports from a package that is not the module's own, past its surface."""
    found = []
    for module in sources():
        for written, name in imported(module):
            if written.partition(".")[0] not in PACKAGES:
                continue
            owner = package_of(written) if written in sources() else written
            own = package_of(module)
            if own == owner or own.startswith(owner + "."):
                continue
            if written != owner or name not in surface(owner):
                found.append(f"{module}: {written}.{name}")
    return found


def longest_chain(graph: Mapping[str, Iterable[str]]) -> list[str]:
    """Return the longest path through `graph`; a cycle counts once."""
    longest: dict[str, list[str]] = {}

    def from_(node: str) -> list[str]:
        if node not in longest:
            longest[node] = [node]  # what a cycle comes back to
            tails = [from_(target) for target in sorted(graph.get(node, ()))]
            longest[node] = [node, *max(tails, key=len, default=[])]
        return longest[node]

    return max((from_(node) for node in sorted(graph)), key=len)


def inside_packages() -> Imports:
    """Return the imports between modules of one package."""
    return {
        module: {
            target
            for target in targets
            if package_of(module) == package_of(target) and not is_package(target)
        }
        for module, targets in dependencies().items()
        if not is_package(module)
    }


def between_packages() -> Imports:
    """Return the imports between packages, the folder's own modules apart."""
    graph: Imports = defaultdict(set)
    for module, targets in dependencies().items():
        for target in targets:
            ours, theirs = package_of(module), package_of(target)
            if ours != theirs and not ours.startswith(theirs + "."):
                graph[ours].add(theirs)
    return graph


def cycles() -> list[str]:
    """Return one cycle of packages, empty where there is none."""
    try:
        TopologicalSorter(between_packages()).prepare()
    except CycleError as error:
        return [" < ".join(error.args[1])]
    return []


def serving_one() -> list[str]:
    """Return modules that exactly one other module imports."""
    users: Imports = defaultdict(set)
    for module, targets in dependencies().items():
        for target in targets:
            users[target].add(module)
    return [
        f"{module} <- {next(iter(used))}"
        for module, used in sorted(users.items())
        if len(used) == 1 and not is_package(module)
    ]


def modules_per_folder() -> Counter[str]:
    return Counter(package_of(m) for m in sources() if not is_package(m))


def duplicated_classes() -> list[str]:
    where: dict[str, list[str]] = defaultdict(list)
    for module, path in sources().items():
        for node in tree_of(path).body:
            if isinstance(node, ast.ClassDef):
                where[node.name].append(module)
    return [f"{name}: {', '.join(w)}" for name, w in where.items() if len(w) > 1]


def private_accesses() -> list[str]:
    """Return where tests reach for what an object of the product keeps to itself."""
    found = []
    for path in sorted((ROOT / "tests").rglob("*.py")):
        for node in ast.walk(tree_of(path)):
            if not isinstance(node, ast.Attribute) or not node.attr.startswith("_"):
                continue
            is_own = isinstance(node.value, ast.Name) and node.value.id in {
                "self",
                "cls",
            }
            is_public = node.attr.startswith("__") or node.attr in DOCUMENTED
            if not is_own and not is_public:
                found.append(f"{path.relative_to(ROOT)}:{node.lineno} {node.attr}")
    return found


def lines_of(node: ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    return (node.end_lineno or node.lineno) - node.lineno + 1


def parameters_of(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    arguments = node.args
    named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    return len([a for a in named if a.arg not in {"self", "cls"}])


def oversized() -> list[str]:
    """Return modules, classes and functions beyond the limits of size."""
    found = []
    for module, path in sources().items():
        length = len(path.read_text().splitlines())
        if length > LONGEST_MODULE:
            found.append(f"{module}: {length} lines")
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ClassDef) and lines_of(node) > LONGEST_CLASS:
                found.append(f"{module}.{node.name}: {lines_of(node)} lines")
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            if lines_of(node) >= LONGEST_FUNCTION:
                found.append(f"{module}.{node.name}: {lines_of(node)} lines")
            if parameters_of(node) > MOST_PARAMETERS:
                found.append(f"{module}.{node.name}: {parameters_of(node)} parameters")
    return found


def undocumented() -> list[str]:
    """Return packages whose `__init__` does not say in two lines what they are for."""
    return [
        package
        for package in sources()
        if is_package(package)
        and len((ast.get_docstring(tree_of(sources()[package])) or "").split("\n")) < 2
    ]


def stale_docstrings() -> list[str]:
    """Return names that an `Attributes:` or `Args:` section keeps and the code lost."""
    return [
        f"{module}.{node.name}: {name}"
        for module, path in sources().items()
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.ClassDef | ast.FunctionDef)
        for name in sorted(documented_names(node) - defined_names(node))
    ]


def documented_names(node: ast.ClassDef | ast.FunctionDef) -> set[str]:
    """Return the names that begin an entry of the docstring's sections."""
    docstring = ast.get_docstring(node) or ""
    sections = re.findall(
        r"^(?:Attributes|Args):\n((?:    .*\n?|\n)*)", docstring, re.M
    )
    entries = re.findall(r"^    ([\w*, ]+):(?: |$)", "".join(sections), re.M)
    return {name.strip(" *") for entry in entries for name in entry.split(",")}


def defined_names(node: ast.ClassDef | ast.FunctionDef) -> set[str]:
    """Return every attribute, method and parameter that `node` defines."""
    inner = list(ast.walk(node))
    return {
        *(n.arg for n in inner if isinstance(n, ast.arg)),
        *(n.id for n in inner if isinstance(n, ast.Name)),
        *(n.attr for n in inner if isinstance(n, ast.Attribute)),
        *(n.name for n in inner if isinstance(n, ast.FunctionDef)),
    }


def measures() -> list[Measure]:
    """Return everything that is measured, in the order of the table."""
    folders = modules_per_folder()
    commands = folders.pop("experiments.commands", 0)
    largest, count = folders.most_common(1)[0]
    chain = longest_chain(inside_packages())

    def listed(name: str, places: list[str], limit: int = 0) -> Measure:
        return Measure(name, len(places), limit, tuple(places))

    return [
        Measure("commands in their folder", commands, MOST_COMMANDS),
        Measure("modules in any other folder", count, MOST_MODULES, (largest,)),
        Measure("import chain in a package", len(chain), LONGEST_CHAIN, tuple(chain)),
        listed("cycles of packages", cycles()),
        listed("modules imported by one other", serving_one(), MOST_SERVING_ONE),
        listed("imports around a public surface", around_surfaces()),
        listed("class names used twice", duplicated_classes()),
        listed("private accesses in tests", private_accesses()),
        listed("modules, classes, functions too large", oversized()),
        listed("packages without a page of docstring", undocumented()),
        listed("documented names that are gone", stale_docstrings()),
    ]


def main() -> int:
    """Print the table; with -v every place. Return 1 where a limit is exceeded."""
    is_long = "-v" in sys.argv
    for measure in measures():
        mark = " " if measure.is_met else "!"
        print(  # noqa: T201
            f"{mark} {measure.name:40} {measure.value:4}   limit {measure.limit}"
        )
        if is_long or not measure.is_met:
            for place in measure.where:
                print(f"      {place}")  # noqa: T201
    return int(not all(measure.is_met for measure in measures()))


if __name__ == "__main__":
    sys.exit(main())
