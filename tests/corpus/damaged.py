"""Damaged inputs of every kind, read in a process with limited memory."""

import json
import multiprocessing
from pathlib import Path

from tests.attacks.attack import Attack, RunBy
from tests.corpus.readers import READERS

_EACH_COMMIT = range(1, 4)
_EACH_NIGHT = [range(first, first + 500) for first in range(1000, 3000, 500)]


def damage_attacks() -> list[Attack]:
    """Return rows of 3 damaged inputs per kind, and nightly ones of 500."""
    rows = [_attack(kind, _EACH_COMMIT, RunBy.CI) for kind in READERS]
    for seeds in _EACH_NIGHT:
        rows += [_attack(kind, seeds, RunBy.NIGHTLY) for kind in READERS]
    return rows


def _attack(kind: str, seeds: range, run_by: RunBy) -> Attack:
    def check(folder: Path) -> None:
        problems = read_damaged(kind, seeds, folder / "output")
        assert not problems, "; ".join(problems)

    return Attack(
        f"{kind} damaged",
        f"seeds {seeds[0]} to {seeds[-1]}",
        "read, or refused with a reason, within 300 MB and 10 s per input",
        check,
        run_by,
        seconds=600,
    )


def read_damaged(kind: str, seeds: range, output: Path) -> list[str]:
    """Read the mutations `seeds` of a kind; return the problems.

    A mutation that crashes the reader is reported; a new process reads the others.
    """
    from tests.corpus.worker import read_mutations  # builds a sample of every kind

    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload([read_mutations.__module__])
    problems: list[str] = []
    while seeds:
        process = processes.Process(target=read_mutations, args=(kind, seeds, output))
        process.start()
        process.join()
        seed, other = seeds.start - 1, ""
        for line in output.read_text().splitlines():
            if line.startswith('{"seed"'):
                seed = json.loads(line)["seed"]
            elif line.startswith('{"error"'):
                problems.append(f"{kind} {seed}: {line}")
            else:
                other += f"{line}\n"
        if process.exitcode == 0:
            break
        problems.append(f"{kind} {seed} ended the reader: {other[-600:]}")
        seeds = range(max(seed, seeds.start) + 1, seeds.stop)
    return problems
