"""Reads mutations in a process of limited memory: `python -m tests.corpus.worker`.

Arguments: kind, first seed, count. Standard output has a line of JSON before each
input, and one after each harmful input.
"""

import faulthandler
import json
import resource
import sys
from pathlib import Path

from tests.corpus.mutations import mutated
from tests.corpus.samples import samples
from tests.corpus.trial import read

MEMORY = 300 * 2**20  # bytes of address space in addition to the libraries
LONGEST = 10.0  # s; beyond it an input hangs


def main(kind: str, seeds: range) -> None:
    """Read the mutations `seeds` of a kind."""
    sound = samples()[kind]
    read(kind, sound)  # imports must not count as memory of an input
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    for seed in seeds:
        say({"seed": seed})
        faulthandler.dump_traceback_later(LONGEST, exit=True)
        verdict = read(kind, mutated(sound, seed))
        faulthandler.cancel_dump_traceback_later()
        if not verdict.is_sound:
            say({"error": verdict.error[:300], "strays": verdict.strays})


def say(value: dict[str, object]) -> None:
    print(json.dumps(value), flush=True)  # noqa: T201


if __name__ == "__main__":
    name, first, count = sys.argv[1:]
    main(name, range(int(first), int(first) + int(count)))
