"""Reads mutations in a process of limited memory: `python -m tests.corpus.worker`.

Arguments: kinds separated by commas, first seed, count for each, folder of failures.
Standard output has a line of JSON before each input and one after it that failed.
"""

import faulthandler
import json
import resource
import sys
from pathlib import Path

from tests.corpus.mutations import mutated
from tests.corpus.samples import samples
from tests.corpus.trial import read

MEMORY = 300 * 2**20  # bytes of address space beside the libraries
LONGEST = 10.0  # s; beyond it an input hangs


def main(kinds: list[str], seeds: range, failures: Path) -> None:
    """Read `seeds` of each kind; write what failed into `failures`."""
    sound = {kind: samples()[kind] for kind in kinds}
    for kind in kinds:
        read(kind, sound[kind])  # whatever it imports is no memory of an input
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    for kind in kinds:
        for seed in seeds:
            say({"kind": kind, "seed": seed})
            data = mutated(sound[kind], seed)
            faulthandler.dump_traceback_later(LONGEST, exit=True)
            found = read(kind, data)
            faulthandler.cancel_dump_traceback_later()
            if not found.is_sound:
                failures.mkdir(exist_ok=True)
                (failures / f"{kind}.{seed}").write_bytes(data)
                say({"error": found.error[:300], "strays": found.strays})
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    say({"peak": peak * 1024, "growth": (peak - before) * 1024})


def say(value: dict[str, object]) -> None:
    print(json.dumps(value), flush=True)  # noqa: T201


if __name__ == "__main__":
    names, first, count, folder = sys.argv[1:]
    start = int(first)
    main(names.split(","), range(start, start + int(count)), Path(folder))
