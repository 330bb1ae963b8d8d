"""Read mutations in a process of limited memory, forked with the libraries loaded."""

import faulthandler
import json
import os
import resource
from pathlib import Path

from tests.corpus.mutations import mutated
from tests.corpus.one_input import read_input
from tests.corpus.samples import samples

MEMORY = 300 * 2**20  # bytes of address space in addition to the libraries
TIMEOUT = 10.0  # s per input
VALID = samples()


def read_mutations(kind: str, seeds: range, output: Path) -> None:
    """Read the mutations of a kind with these seeds.

    `output` gets a line of JSON before each input, one after each input that caused a
    failure, and what the process says.
    """
    with output.open("w") as stream:
        os.dup2(stream.fileno(), 1)
        os.dup2(stream.fileno(), 2)
    read_input(kind, VALID[kind])  # imports must not count towards the memory limit
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    for seed in seeds:
        write_json({"seed": seed})
        faulthandler.dump_traceback_later(TIMEOUT, exit=True, file=2)
        verdict = read_input(kind, mutated(VALID[kind], seed))
        faulthandler.cancel_dump_traceback_later()
        if not verdict.is_sound:
            write_json({"error": verdict.error[:300], "strays": verdict.strays})


def write_json(value: dict[str, object]) -> None:
    os.write(1, f"{json.dumps(value)}\n".encode())
