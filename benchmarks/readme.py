"""README's figures: those of the demo from its results, speeds from docs/measured.md.

Exit 1 where README drifted, or where the report warns of the simulated rig of the demo,
which has no flaw. Rows of docs/measured.md stand between two marks and are put there.

    make demo && python benchmarks/readme.py [--folder demo]
    python benchmarks/readme.py --write      # the rows of docs/measured.md alone
"""

import argparse
import json
import re
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
README, MEASURED = ROOT / "README.md", ROOT / "docs" / "measured.md"
BEGIN, END = "<!-- from docs/measured.md -->\n", "<!-- end of it -->"
SHOWN = (  # first words of the rows of docs/measured.md that README shows
    "stepped simulation with recorder",
    "SE fit, n = 300",
    "the same against GPy",
    "the same against tinygp",
    "cycles of one 30 s trial read",
    "the same against mcap iter_messages",
    "13 frames of a cycle, coded and decoded",
    "`status`, 1,000 sessions",
    "recorder at 5000 cycles/s",
)
_NUMBER = re.compile(r"\d+(?:\.\d+)?")
_DRIFT = 0.05


def demo_rows(fits: dict[str, Any]) -> list[str]:
    """Return the rows of README's table that the demo's fits.json gives."""
    plate, stones = fits["terrains"]["TF"], fits["terrains"]["S0"]
    true = next(t for t in fits["tables"] if t["name"] == "Measured against true")
    v_t, F_t, F_n = (
        statistics.median(float(row[column]) for row in true["rows"])
        for column in (1, 2, 3)
    )
    return [
        "| mean absolute error, plate with tread (TF): Tustin, GP, a constant "
        f"| {_errors(plate)} | `make demo`, Summary of the report |",
        f"| the same, small stones (S0) | {_errors(stones)} | same |",
        f"| measured against true over the {len(true['rows'])} trials, median: v_t, "
        f"F_t, F_n | {v_t:.1f} mm/s, {F_t:.2f} N, {F_n:.2f} N | same, table "
        '"Measured against true" |',
    ]


def _errors(terrain: dict[str, Any]) -> str:
    mae = terrain["mae"]
    values = (mae["tustin"], mae["gp_se"], terrain["constant_mae"])
    return ", ".join(f"{value:.2f}" for value in values) + " N"


def measured_rows(page: str) -> list[str]:
    """Return the rows of docs/measured.md for README, in the order of `SHOWN`.

    Raises:
        ValueError: the table lacks one of `SHOWN`, or it was not measured.
    """
    table = [line.strip("| ").split(" | ") for line in page.splitlines() if "|" in line]
    rows: list[str] = []
    for start in SHOWN:
        found = [cells for cells in table if cells[0].startswith(start)]
        if not found or found[0][1] == "-":
            raise ValueError(f"docs/measured.md has no figure of: {start}")
        what, today, *_, name = found[0]
        rows.append(f"| {what} | {today} | `python -m benchmarks --only {name}` |")
    return rows


def with_rows(readme: str, rows: Sequence[str]) -> str:
    """Return README with these rows between its marks.

    Raises:
        ValueError: it has no marks.
    """
    before, begin, rest = readme.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError("README has no marks for the rows of docs/measured.md")
    head = ["| what | figure | command |", "|---|---|---|"]
    text = "\n".join([*head, *rows])
    return f"{before}{begin}\n{text}\n\n{end}{after}"


def is_same(row: str, told: str) -> bool:
    """Return whether a line of README says what a row does, to 5 % of each number.

    Libraries of linear algebra differ in the last digits from machine to machine.
    """
    if _NUMBER.sub("#", row) != _NUMBER.sub("#", told):
        return False
    pairs = zip(_NUMBER.findall(row), _NUMBER.findall(told), strict=True)
    return all(abs(float(a) - float(b)) <= _DRIFT * float(a) for a, b in pairs)


def main() -> int:
    """Print the rows; say which README does not have."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=ROOT / "demo")
    parser.add_argument("--write", action="store_true", help=f"into {README.name}")
    arguments = parser.parse_args()
    folder, readme = arguments.folder, README.read_text()
    renewed = with_rows(readme, measured_rows(MEASURED.read_text()))
    if arguments.write:
        README.write_text(renewed)
        return 0
    if renewed != readme:
        print("! README shows other figures than docs/measured.md: --write puts them")
        return 1
    fits = json.loads((folder / "study" / "fits.json").read_text())
    rows = demo_rows(fits)
    told = readme.splitlines()
    drifted = [row for row in rows if not any(is_same(row, line) for line in told)]
    for row in rows:
        print(f"{'!' if row in drifted else ' '} {row}")
    for warning in fits["warnings"]:
        print(f"! {warning}")
    return 1 if drifted or fits["warnings"] else 0


if __name__ == "__main__":
    sys.exit(main())
