"""Read mutations in a process of limited memory: `python -m tests.corpus.worker`.

Arguments: kind, first seed, count. Prints a line of JSON before each input, and one
after each input that caused a failure.
"""

import faulthandler
import json
import resource
import sys
from pathlib import Path

from tests.corpus.mutations import mutated
from tests.corpus.one_input import read_input
from tests.corpus.samples import samples

MEMORY = 300 * 2**20  # bytes of address space in addition to the libraries
TIMEOUT = 10.0  # s per input


def main(kind: str, seeds: range) -> None:
    """Read the mutations of a kind with these seeds; print failures."""
    valid = samples()[kind]
    read_input(kind, valid)  # imports must not count towards the memory limit
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    for seed in seeds:
        print_json({"seed": seed})
        faulthandler.dump_traceback_later(TIMEOUT, exit=True)
        verdict = read_input(kind, mutated(valid, seed))
        faulthandler.cancel_dump_traceback_later()
        if not verdict.is_sound:
            print_json({"error": verdict.error[:300], "strays": verdict.strays})


def print_json(value: dict[str, object]) -> None:
    print(json.dumps(value), flush=True)  # noqa: T201


if __name__ == "__main__":
    name, first, count = sys.argv[1:]
    main(name, range(int(first), int(first) + int(count)))
