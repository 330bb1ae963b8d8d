"""Break disks: `python -m tests.crash power-cuts|io-errors|KIND [COUNT] [SEED]`.

A kind of broken disk is one of `io_errors.KINDS`, such as broken-read.
"""

import sys
import tempfile
from pathlib import Path

from tests.crash.io_errors import KINDS, fail
from tests.crash.power_cuts import record_session, survive


def main(what: str, count: int, seed: int) -> int:
    """Return how many things went wrong."""
    with tempfile.TemporaryDirectory(prefix="crash-") as scratch:
        folder = Path(scratch)
        if what != "power-cuts":
            kinds = KINDS if what == "io-errors" else (what,)
            wrong = fail(folder, count, seed, kinds)
        else:
            wrong = survive(record_session(folder), folder, count, seed)
        for text in wrong:
            print(text)  # noqa: T201
        print(f"{count} {what}, {len(wrong)} problems")  # noqa: T201
    return len(wrong)


if __name__ == "__main__":
    asked = [int(word) for word in sys.argv[2:]]
    sys.exit(main(sys.argv[1], *(asked + [1000, 1][len(asked) :])) > 0)
