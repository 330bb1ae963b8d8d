"""Compare README's figures of the demo with the demo's results.

Exits with 1 if README is out of date, or if the report warns about the demo's simulated
rig, which has no fault.

    make demo && python benchmarks/readme.py [--folder demo]
"""

import argparse
import json
import re
import statistics
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
_NUMBER = re.compile(r"\d+(?:\.\d+)?")
_DRIFT = 0.05


def demo_rows(fits: dict[str, Any]) -> list[str]:
    """Return the rows of README's table from the demo's fits.json."""
    plate, stones = fits["terrains"]["TF"], fits["terrains"]["S0"]
    errors = next(t for t in fits["tables"] if t["name"] == "Measured against true")
    v_t, F_t, F_n = (
        statistics.median(float(row[column]) for row in errors["rows"])
        for column in (1, 2, 3)
    )
    return [
        "| mean absolute error, plate with tread (TF): Tustin, GP, a constant "
        f"| {_errors(plate)} | `make demo`, Summary of the report |",
        f"| mean absolute error, small stones (S0) | {_errors(stones)} | same |",
        f"| error of the simulated measurement over the {len(errors['rows'])} trials, "
        f"median: v_t, F_t, F_n | {v_t:.1f} mm/s, {F_t:.2f} N, {F_n:.2f} N "
        "| same, table "
        '"Measured against true" |',
    ]


def _errors(terrain: dict[str, Any]) -> str:
    mae = terrain["mae"]
    values = (mae["tustin"], mae["gp_se"], terrain["constant_mae"])
    return ", ".join(f"{value:.2f}" for value in values) + " N"


def is_same(row: str, printed: str) -> bool:
    """Return whether a line of README equals a row, each number within 5 %.

    Linear-algebra libraries differ in the last digits from machine to machine.
    """
    if _NUMBER.sub("#", row) != _NUMBER.sub("#", printed):
        return False
    pairs = zip(_NUMBER.findall(row), _NUMBER.findall(printed), strict=True)
    return all(abs(float(a) - float(b)) <= _DRIFT * float(a) for a, b in pairs)


def main() -> int:
    """Print the rows and mark those that README does not contain."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=ROOT / "demo")
    folder, readme = parser.parse_args().folder, README.read_text()
    fits = json.loads((folder / "study" / "fits.json").read_text())
    rows = demo_rows(fits)
    lines = readme.splitlines()
    drifted = [row for row in rows if not any(is_same(row, line) for line in lines)]
    for row in rows:
        print(f"{'!' if row in drifted else ' '} {row}")
    for warning in fits["warnings"]:
        print(f"! {warning}")
    return 1 if drifted or fits["warnings"] else 0


if __name__ == "__main__":
    sys.exit(main())
