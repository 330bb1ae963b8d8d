"""Run every set of real data against its right answers: `python -m tests.judges`.

Reads ../shared/data/real, or the given folder, and prints value, right answer and
verdict; ends with 1 if a verdict is wrong, and with 75 if there are no data.
"""

import argparse
import sys
from pathlib import Path

from tests.judges.sets import SETS

REAL = Path(__file__).resolve().parents[3] / "shared" / "data" / "real"
NO_DATA = 75


def main(arguments: list[str]) -> int:
    """Print the judgements; the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.judges")
    parser.add_argument("folder", nargs="?", type=Path, default=REAL)
    parser.add_argument("--sets", default=",".join(SETS), help="only these")
    args = parser.parse_args(arguments)
    if not args.folder.is_dir():
        print(f"no measurements in {args.folder}")  # noqa: T201
        return NO_DATA
    strangers = {path.name for path in args.folder.iterdir() if path.is_dir()}
    wrong = 0
    for stranger in sorted(strangers - set(SETS)):
        print(f"WRONG  {stranger}: nobody judges by it")  # noqa: T201
        wrong += 1
    count = 0
    for name in filter(None, args.sets.split(",")):
        for judgement in SETS[name](args.folder / name):
            print(judgement.line(), flush=True)  # noqa: T201
            wrong += not judgement.is_right
            count += 1
    print(f"{count} judgements, {wrong} wrong")  # noqa: T201
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
