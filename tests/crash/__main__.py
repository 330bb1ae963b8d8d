"""Cut the power many times: `python -m tests.crash [CUTS] [SEED]`."""

import sys
import tempfile
from pathlib import Path

from tests.crash.power_cuts import record_session, survive


def main(cuts: int, seed: int) -> int:
    """Return how many things went wrong."""
    with tempfile.TemporaryDirectory(prefix="crash-") as folder:
        recording = record_session(Path(folder))
        wrong = survive(recording, Path(folder), cuts, seed)
        for text in wrong:
            print(text)  # noqa: T201
        print(f"{cuts} power cuts, {len(wrong)} problems")  # noqa: T201
    return len(wrong)


if __name__ == "__main__":
    asked = [int(word) for word in sys.argv[1:]]
    sys.exit(main(*(asked + [1000, 1][len(asked) :])) > 0)
