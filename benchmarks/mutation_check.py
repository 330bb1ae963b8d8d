"""Mutation testing of the safety-critical and decision code; run manually.

python -m benchmarks.mutation_check [--count 300] [--seed 1] [--round 0] [--only guard]

Every mutation (a flipped comparison, operator or sign, a negated condition, a removed
statement) is run against the tests of its module in a copy of the tree, with a time
limit. Rounds of the same seed share no mutation.
"""

import argparse
import ast
import copy
import importlib
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.clock import SystemClock
from benchmarks.mutation_targets import EQUIVALENT, TESTS

ROOT = Path(__file__).parents[1]
# A mutation that hangs counts as killed. Time limit: eight times the usual duration,
# at least 10 s.
SHORTEST_LIMIT, LIMIT_FACTOR = 10.0, 8.0
REQUIRED = 0.95  # share of mutations that the tests must kill
LIBRARIES = ("hypothesis", "mcap", "pinocchio", "pydantic", "pytest", "scipy.linalg")
_COPIED = ("acquisition", "analysis", "experiments", "fakes", "ft_sensor", "wam")
_FLIPPED = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}


@dataclass(frozen=True, slots=True)
class Mutation:
    """A change of one syntax node.

    Attributes:
        path: path of the module.
        line: line of the node.
        text: the changed line, before and after.
        source: source of the mutated module.
    """

    path: str
    line: int
    text: str
    source: str


def _changes(node: ast.AST) -> Iterator[Callable[[Any], None]]:
    """Yield the possible changes of a node, as functions applied to its copy."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in _FLIPPED:
        yield lambda n: n.ops.__setitem__(0, _FLIPPED[type(n.ops[0])]())
    if isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in _FLIPPED:
        yield lambda n: setattr(n, "op", _FLIPPED[type(n.op)]())
    if _is_negation(node):
        yield lambda n: setattr(n, "op", ast.UAdd())
    if isinstance(node, ast.If | ast.IfExp) and not isinstance(node.test, ast.Compare):
        yield lambda n: setattr(n, "test", ast.UnaryOp(ast.Not(), n.test))
    if isinstance(node, ast.FunctionDef | ast.If | ast.For):
        for index, statement in enumerate(node.body):
            if _is_removable(statement):
                yield lambda n, i=index: n.body.__setitem__(i, ast.Pass())


def _is_negation(node: ast.AST) -> bool:
    """Return whether a node negates a value; a negative literal is data."""
    return (
        isinstance(node, ast.UnaryOp)
        and isinstance(node.op, ast.USub)
        and not isinstance(node.operand, ast.Constant)
    )


def _is_removable(statement: ast.stmt) -> bool:
    """Return whether removing a statement may change the behaviour."""
    if isinstance(statement, ast.Expr):
        return not isinstance(statement.value, ast.Constant)
    return isinstance(statement, ast.Raise | ast.AugAssign | ast.If)


def _skipped(tree: ast.Module) -> set[int]:
    """Return the ids of the nodes that are not mutated.

    These are annotations, decorators and formatted messages.
    """
    hidden: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            hidden |= {id(n) for n in ast.walk(node)}
        for name in ("annotation", "returns", "decorator_list"):
            part = getattr(node, name, None)
            for root in part if isinstance(part, list) else [part]:
                hidden |= {id(n) for n in ast.walk(root)} if root else set()
    return hidden


def mutations(path: str) -> list[Mutation]:
    """Return every mutation of a module that is not known to be equivalent."""
    tree = ast.parse((ROOT / path).read_text())
    nodes, hidden = list(ast.walk(tree)), _skipped(tree)
    original = ast.unparse(tree)
    results: list[Mutation] = []
    for index, node in enumerate(nodes):
        if id(node) in hidden:
            continue
        for number, _ in enumerate(_changes(node)):
            changed = copy.deepcopy(tree)
            twin = list(ast.walk(changed))[index]
            list(_changes(twin))[number](twin)
            source = ast.unparse(ast.fix_missing_locations(changed))
            text = _first_change(original, source)
            if text and (path, text) not in EQUIVALENT:
                results.append(Mutation(path, getattr(node, "lineno", 0), text, source))
    return results


def _first_change(before: str, after: str) -> str:
    """Return the first line that differs as "before -> after"; "" for none."""
    for old, new in zip(before.splitlines(), after.splitlines(), strict=False):
        if old != new:
            return f"{old.strip()} -> {new.strip()}"
    return ""


class MutatedTree:
    """A copy of the project; its tests run in forks with the libraries loaded."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._time_limits: dict[str, float] = {}
        for name in (*_COPIED, "tests"):
            shutil.copytree(ROOT / name, folder / name, ignore=_CACHES)
        for name in ("pyproject.toml", "SECURITY.md"):
            shutil.copy(ROOT / name, folder)
        self._processes = multiprocessing.get_context("forkserver")
        self._processes.set_forkserver_preload(list(LIBRARIES))

    def passes_unmutated(self, path: str) -> bool:
        """Run the tests without a mutation and time them; return whether they pass."""
        started_ns = SystemClock().now_ns()
        code = self._exit_code(TESTS[path], 60.0 * LIMIT_FACTOR, keeps_bytecode=True)
        self._time_limits[path] = max(
            SHORTEST_LIMIT,
            LIMIT_FACTOR * ((SystemClock().now_ns() - started_ns) * 1e-9),
        )
        return code == 0

    def is_killed(self, mutation: Mutation) -> bool:
        """Return whether the tests of the module fail with the mutation."""
        target = self._folder / mutation.path
        original = target.read_text()
        target.write_text(mutation.source)
        tests, time_limit = TESTS[mutation.path], self._time_limits[mutation.path]
        try:
            return self._exit_code(tests, time_limit, keeps_bytecode=False) != 0
        finally:
            target.write_text(original)

    def _exit_code(
        self, tests: tuple[str, ...], time_limit: float, *, keeps_bytecode: bool
    ) -> int | None:
        """Return pytest's exit code; None = timed out."""
        process = self._processes.Process(
            target=run_tests, args=(self._folder, tests, keeps_bytecode)
        )
        process.start()
        process.join(time_limit)
        if process.exitcode is None:
            os.killpg(process.pid or 0, signal.SIGKILL)
            process.join()
            return None
        return process.exitcode


def run_tests(folder: Path, tests: tuple[str, ...], keeps_bytecode: bool) -> None:
    """Run `tests` of the project in `folder`; exit this process with pytest's code."""
    os.setsid()
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    for name in [n for n in sys.modules if n.split(".")[0] in (*_COPIED, "tests")]:
        del sys.modules[name]
    sys.dont_write_bytecode = not keeps_bytecode
    with Path(os.devnull).open("w") as null:
        os.dup2(null.fileno(), 1)
        os.dup2(null.fileno(), 2)
    pytest = importlib.import_module("pytest")
    hypothesis = importlib.import_module("hypothesis")
    # Any failure is enough: shrinking it to a minimal example takes a minute.
    phases = [hypothesis.Phase.explicit, hypothesis.Phase.generate]
    hypothesis.settings.register_profile("mutation", phases=phases)
    hypothesis.settings.load_profile("mutation")
    # pytest cannot rewrite modules that are already imported; it does not need to.
    rewriting = "ignore::pytest.PytestAssertRewriteWarning"
    options = ["-x", "-p", "no:cacheprovider", "-W", rewriting]
    os._exit(int(pytest.main([*options, *tests])))


def sample(count: int, seed: int, round_number: int, only: str) -> list[Mutation]:
    """Return one round of about `count` mutations, equally many per module."""
    paths = [path for path in TESTS if only in path]
    size = -(-count // len(paths))
    chosen: list[Mutation] = []
    for path in paths:
        pool = mutations(path)
        order = np.random.default_rng(seed).permutation(len(pool))
        part = order[round_number * size : (round_number + 1) * size]
        chosen += [pool[i] for i in sorted(part)]
    return chosen


def main() -> int:
    """Print every mutation and the share that was killed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--round", type=int, default=0, help="round of this seed")
    parser.add_argument("--only", default="", help="part of a module's path")
    args = parser.parse_args()
    chosen, killed = sample(args.count, args.seed, args.round, args.only), 0
    with tempfile.TemporaryDirectory(prefix="mutations-") as scratch:
        tree = MutatedTree(Path(scratch))
        paths = dict.fromkeys(mutation.path for mutation in chosen)
        unsound = [path for path in paths if not tree.passes_unmutated(path)]
        if unsound:
            print("fail without a mutation:", *unsound)
            return 2
        for mutation in chosen:
            is_killed = tree.is_killed(mutation)
            killed += is_killed
            word = "killed" if is_killed else "SURVIVED"
            print(
                f"{word:8} {mutation.path}:{mutation.line} {mutation.text}", flush=True
            )
    print(f"{killed} of {len(chosen)} killed, {killed / len(chosen):.0%}")
    return 0 if killed >= REQUIRED * len(chosen) else 1


_CACHES = shutil.ignore_patterns("__pycache__", "*.pyc")

if __name__ == "__main__":
    sys.exit(main())
