"""Fuzz every reader: `python -m tests.corpus --count 10000 --seed 1`.

Each kind of input is read in a process of its own, under a limit of memory and time.
What fails goes to corpus-failures/ in the present folder; small ones that show
something new belong into tests/data/corpus.
"""

import argparse
import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from tests.corpus.readers import READERS

ROOT = Path(__file__).parents[2]


@dataclass(slots=True)
class FuzzResult:
    """What became of the inputs of one kind.

    Attributes:
        kind: of the inputs.
        inputs: how many were read.
        failures: what failed, in words.
        hangs: inputs at which the process ended or hung.
        peak: most memory of the process, libraries included [bytes].
        growth: of it, beyond what a sound input needs [bytes].
    """

    kind: str
    inputs: int = 0
    failures: list[str] = field(default_factory=list)
    hangs: list[str] = field(default_factory=list)
    peak: int = 0
    growth: int = 0

    def text(self) -> str:
        return (
            f"{self.kind}: {self.inputs} inputs, {len(self.failures)} tracebacks, "
            f"{len(self.hangs)} hangs, peak {self.peak / 2**20:.0f} MB "
            f"(+{self.growth / 2**20:.0f})"
        )


def fuzz(kind: str, seeds: range, failures: Path) -> FuzzResult:
    """Read the mutations `seeds` of a kind; go on behind one that ends the process."""
    result = FuzzResult(kind)
    while seeds:
        command = [sys.executable, "-m", "tests.corpus.worker", kind]
        command += [str(seeds.start), str(len(seeds)), str(failures)]
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, check=False
        )
        last = seeds.start - 1
        for said in map(json.loads, done.stdout.splitlines()):
            if "seed" in said:
                last = said["seed"]
                result.inputs += 1
            elif "error" in said:
                result.failures.append(f"{kind} {last}: {said}")
            else:
                result.peak = max(result.peak, said["peak"])
                result.growth = max(result.growth, said["growth"])
        if done.returncode == 0:
            break
        result.hangs.append(f"{kind} {last}: {done.stderr[-600:]}")
        seeds = range(max(last, seeds.start) + 1, seeds.stop)
    return result


def main(arguments: list[str]) -> int:
    """Fuzz, print what came of it, and return how many inputs did harm."""
    parser = argparse.ArgumentParser(prog="python -m tests.corpus")
    parser.add_argument("--count", type=int, default=5000, help="inputs in all")
    parser.add_argument("--seed", type=int, default=1, help="of the first input")
    parser.add_argument("--kinds", default=",".join(READERS), help="only these")
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args(arguments)
    kinds = args.kinds.split(",")
    seeds = range(args.seed, args.seed + -(-args.count // len(kinds)))
    failures = Path("corpus-failures").resolve()
    results: list[FuzzResult] = []
    with ThreadPoolExecutor(args.workers) as pool:
        for result in pool.map(lambda kind: fuzz(kind, seeds, failures), kinds):
            results.append(result)
            print("\n".join([*result.failures, *result.hangs, result.text()]))  # noqa: T201
    total = sum(result.inputs for result in results)
    harm = sum(len(r.failures) + len(r.hangs) for r in results)
    peak, growth = max(r.peak for r in results), max(r.growth for r in results)
    print(  # noqa: T201
        f"{total} inputs, {harm} of them did harm, "
        f"peak memory {peak / 2**20:.0f} MB (+{growth / 2**20:.0f})"
    )
    return harm


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]) > 0)
