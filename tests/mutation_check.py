"""Small errors sown into the code that decides: do the tests notice? Run by hand.

python tests/mutation_check.py [--count 300] [--seed 1] [--only guard]

Every mutation - a comparison flipped, a constant or sign changed, a statement removed -
is run against the tests of its module in a copy of the tree, with a time limit.
"""

import argparse
import ast
import copy
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
_LOOP, _LOOP_TESTS = "acquisition/control_loop", "tests/acquisition/control_loop"
_CONTROL, _CONTROL_TESTS = "wam/control", "tests/wam/control"
_DRIVER, _DRIVER_TESTS = "wam/driver", "tests/wam/driver"
TESTS = {
    f"{_LOOP}/guard.py": (f"{_LOOP_TESTS}/test_guard.py",),
    f"{_LOOP}/cycle.py": (
        f"{_LOOP_TESTS}/test_cycle.py",
        "tests/wam/control/test_move_in_the_cycle.py",
    ),
    f"{_LOOP}/states.py": (f"{_LOOP_TESTS}/test_states.py",),
    f"{_LOOP}/faults.py": (f"{_LOOP_TESTS}/test_faults.py",),
    f"{_LOOP}/limits.py": (f"{_LOOP_TESTS}/test_torque_limiter.py",),
    "acquisition/ipc/loop_server.py": ("tests/acquisition/ipc/test_loop_server.py",),
    f"{_CONTROL}/controller.py": (f"{_CONTROL_TESTS}/test_controller.py",),
    f"{_CONTROL}/joint_lock.py": (f"{_CONTROL_TESTS}/test_joint_lock.py",),
    f"{_CONTROL}/position_control.py": (f"{_CONTROL_TESTS}/test_joint_move.py",),
    f"{_CONTROL}/soft_walls.py": (f"{_CONTROL_TESTS}/test_soft_walls.py",),
    f"{_DRIVER}/transmission.py": (f"{_DRIVER_TESTS}/test_transmission.py",),
    f"{_DRIVER}/status_poller.py": (
        f"{_DRIVER_TESTS}/test_status_poller.py",
        f"{_DRIVER_TESTS}/test_arm.py",
    ),
    f"{_DRIVER}/joint_estimator.py": (
        f"{_DRIVER_TESTS}/test_arm.py",
        f"{_DRIVER_TESTS}/test_lost_replies.py",
    ),
    f"{_DRIVER}/startup.py": ("tests/experiments/preflight/test_zero_check.py",),
    "wam/model/clearance.py": ("tests/wam/model/test_clearance.py",),
    "wam/bus/frames.py": ("tests/wam/bus/test_frames.py",),
    "ft_sensor/payload.py": ("tests/ft_sensor/test_payload.py",),
    "ft_sensor/tare.py": ("tests/ft_sensor/test_tare.py",),
    "experiments/session/reducer.py": ("tests/experiments/session/test_reducer.py",),
    "experiments/session/crash_recovery.py": (
        "tests/experiments/session/test_crash_recovery.py",
    ),
    "analysis/data/prepare.py": ("tests/analysis/data/test_prepare.py",),
}
TIMEOUT = 120.0  # s; a mutation that hangs is noticed
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
    """A change of one node.

    Attributes:
        path: of the module.
        line: where.
        text: what was changed.
        source: the module with it.
    """

    path: str
    line: int
    text: str
    source: str


def _changes(node: ast.AST) -> Iterator[Callable[[ast.AST], None]]:
    """Return what may be done to a node, as functions of its copy."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in _FLIPPED:
        yield lambda n: n.ops.__setitem__(0, _FLIPPED[type(n.ops[0])]())
    if isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in _FLIPPED:
        yield lambda n: setattr(n, "op", _FLIPPED[type(n.op)]())
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield lambda n: setattr(n, "op", ast.UAdd())
    if isinstance(node, ast.If | ast.IfExp):
        yield lambda n: setattr(n, "test", ast.UnaryOp(ast.Not(), n.test))
    if isinstance(node, ast.Constant) and type(node.value) in {int, float}:
        yield lambda n: setattr(n, "value", n.value + 1)
    if isinstance(node, ast.FunctionDef | ast.If | ast.For):
        for place, statement in enumerate(node.body):
            if _is_removable(statement):
                yield lambda n, i=place: n.body.__setitem__(i, ast.Pass())


def _is_removable(statement: ast.stmt) -> bool:
    """Return whether a statement does something and is no docstring."""
    if isinstance(statement, ast.Expr):
        return not isinstance(statement.value, ast.Constant)
    return isinstance(statement, ast.Raise | ast.AugAssign | ast.If)


def _skipped(tree: ast.Module) -> set[int]:
    """Return nodes that no test can see: annotations, and what they hold."""
    hidden: set[int] = set()
    for node in ast.walk(tree):
        for name in ("annotation", "returns", "decorator_list"):
            part = getattr(node, name, None)
            for root in part if isinstance(part, list) else [part]:
                hidden |= {id(n) for n in ast.walk(root)} if root else set()
    return hidden


def mutations(path: str) -> list[Mutation]:
    """Return every mutation of a module."""
    tree = ast.parse((ROOT / path).read_text())
    nodes, hidden = list(ast.walk(tree)), _skipped(tree)
    found: list[Mutation] = []
    for place, node in enumerate(nodes):
        if id(node) in hidden:
            continue
        for number, _ in enumerate(_changes(node)):
            changed = copy.deepcopy(tree)
            twin = list(ast.walk(changed))[place]
            list(_changes(twin))[number](twin)
            source = ast.unparse(ast.fix_missing_locations(changed))
            before, after = ast.unparse(node), ast.unparse(twin)
            text = f"{before.splitlines()[0][:60]} -> {after.splitlines()[0][:60]}"
            if before != after:
                if before.splitlines()[0] == after.splitlines()[0]:
                    text = f"a statement removed below: {before.splitlines()[0][:50]}"
                found.append(Mutation(path, getattr(node, "lineno", 0), text, source))
    return found


def is_killed(mutation: Mutation, tree: Path) -> bool:
    """Return whether the tests of the module notice."""
    target = tree / mutation.path
    sound = target.read_text()
    target.write_text(mutation.source)
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    try:
        done = subprocess.run(
            [*command, *TESTS[mutation.path]],
            cwd=tree,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            check=False,
            timeout=TIMEOUT,
        )
    except subprocess.TimeoutExpired:
        return True
    finally:
        target.write_text(sound)
    return done.returncode != 0


def sample(count: int, seed: int, only: str) -> list[Mutation]:
    """Return about `count` mutations, as many of every module."""
    rng = np.random.default_rng(seed)
    paths = [path for path in TESTS if only in path]
    chosen: list[Mutation] = []
    for path in paths:
        every = mutations(path)
        size = min(len(every), -(-count // len(paths)))
        chosen += [
            every[i] for i in sorted(rng.choice(len(every), size, replace=False))
        ]
    return chosen


def main() -> int:
    """Print every survivor and the share that was killed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="part of a module's path")
    given = parser.parse_args()
    chosen, killed = sample(given.count, given.seed, given.only), 0
    with tempfile.TemporaryDirectory(prefix="mutations-") as place:
        tree = Path(place)
        for name in (*_COPIED, "tests"):
            shutil.copytree(ROOT / name, tree / name, ignore=_CACHES)
        shutil.copy(ROOT / "pyproject.toml", tree)
        for mutation in chosen:
            is_dead = is_killed(mutation, tree)
            killed += is_dead
            word = "killed" if is_dead else "SURVIVED"
            print(  # noqa: T201
                f"{word:8} {mutation.path}:{mutation.line} {mutation.text}", flush=True
            )
    print(f"{killed} of {len(chosen)} killed, {killed / len(chosen):.0%}")  # noqa: T201
    return 0 if killed >= 0.9 * len(chosen) else 1


_CACHES = shutil.ignore_patterns("__pycache__", "*.pyc")

if __name__ == "__main__":
    sys.exit(main())
