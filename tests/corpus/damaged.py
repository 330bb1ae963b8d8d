"""Damaged inputs of every kind, read in a process with limited memory."""

import json
import subprocess
import sys
from pathlib import Path

from tests.attacks.attack import Attack, RunBy
from tests.corpus.readers import READERS

ROOT = Path(__file__).parents[2]
_EACH_COMMIT = range(1, 4)
_EACH_NIGHT = [range(first, first + 500) for first in range(1000, 3000, 500)]


def damage_attacks() -> list[Attack]:
    """Return rows of 3 damaged inputs per kind, and nightly ones of 500."""
    rows = [_attack(kind, _EACH_COMMIT, RunBy.CI) for kind in READERS]
    for seeds in _EACH_NIGHT:
        rows += [_attack(kind, seeds, RunBy.NIGHTLY) for kind in READERS]
    return rows


def _attack(kind: str, seeds: range, run_by: RunBy) -> Attack:
    def check(_: Path) -> None:
        problems = read_damaged(kind, seeds)
        assert not problems, "; ".join(problems)

    return Attack(
        f"{kind} damaged",
        f"seeds {seeds[0]} to {seeds[-1]}",
        "read, or refused with a reason, within 300 MB and 10 s per input",
        check,
        run_by,
        seconds=600,
    )


def read_damaged(kind: str, seeds: range) -> list[str]:
    """Read the mutations `seeds` of a kind; return the problems.

    A mutation that crashes the reader is reported; a new process reads the others.
    """
    problems: list[str] = []
    while seeds:
        command = [sys.executable, "-m", "tests.corpus.worker", kind]
        command += [str(seeds.start), str(len(seeds))]
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, check=False
        )
        seed = seeds.start - 1
        for line in map(json.loads, done.stdout.splitlines()):
            if "seed" in line:
                seed = line["seed"]
            else:
                problems.append(f"{kind} {seed}: {line}")
        if done.returncode == 0:
            break
        problems.append(f"{kind} {seed} ended the reader: {done.stderr[-600:]}")
        seeds = range(max(seed, seeds.start) + 1, seeds.stop)
    return problems
