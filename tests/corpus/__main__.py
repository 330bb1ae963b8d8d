"""Fuzz every reader: `python -m tests.corpus [INPUTS] [SEED]`; failures are kept.

What fails goes to corpus-failures/ in the present folder; small ones that show
something new belong into tests/data/corpus.
"""

import sys
from pathlib import Path

from tests.corpus.mutations import mutated
from tests.corpus.samples import samples
from tests.corpus.trial import read

LIMIT = 2.0  # s of CPU


def main(inputs: int, first: int) -> int:
    """Read so many mutations of each sample; return how many failed."""
    failures = 0
    for name, sample in samples().items():
        slowest = 0.0
        for seed in range(first, first + inputs):
            data = mutated(sample, seed)
            found = read(name, data)
            slowest = max(slowest, found.seconds)
            if found.is_sound and found.seconds <= LIMIT:
                continue
            failures += 1
            folder = Path("corpus-failures")
            folder.mkdir(exist_ok=True)
            (folder / f"{name}.{seed}").write_bytes(data)
            print(f"{name} {seed}: {found.error[:300]} {found.strays}")  # noqa: T201
        print(f"{name}: {inputs} inputs, slowest {slowest:.3f} s")  # noqa: T201
    return failures


if __name__ == "__main__":
    asked = [int(word) for word in sys.argv[1:]]
    sys.exit(main(*(asked + [200, 1][len(asked) :])) > 0)
