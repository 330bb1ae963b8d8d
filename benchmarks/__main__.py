"""All benchmarks, one table: what, today, goal, met or not.

    python -m benchmarks [--only NAME ...] [--write]

Each benchmark runs in a process of its own, one after the other, with the program's
settings of linear algebra. `--write` puts the table into docs/measured.md, between its
marks.
"""

import argparse
import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

from acquisition.linear_algebra import openblas_settings
from benchmarks.rows import BenchRow
from benchmarks.surroundings import surroundings

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "measured.md"
BEGIN, END = "<!-- python -m benchmarks -->", "<!-- end of the table -->"
NAMES = (
    "lockstep",
    "fit",
    "analysis_speed",
    "scale",
    "cluster",
    "can_transports",
    "codec",
    "load",
    "recorder",
    "whole_programs",
)
PEERS = ("scikit-learn", "GPy", "tinygp", "jax", "numpy", "scipy", "python-can", "mcap")
_LIMIT_S = 600
_MARK = "ROWS "


def run_one(name: str) -> list[BenchRow]:
    """Return the rows of one benchmark, run in a process of its own."""
    command = [sys.executable, "-m", "benchmarks", "--inside", name]
    try:
        done = subprocess.run(
            command,
            cwd=ROOT,
            env=os.environ | openblas_settings(),
            capture_output=True,
            text=True,
            timeout=_LIMIT_S,
            check=True,
        )
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        return [BenchRow(name, None, "", note=f"failed: {type(error).__name__}")]
    (line,) = (x for x in done.stdout.splitlines() if x.startswith(_MARK))
    return [BenchRow(**row) for row in json.loads(line.removeprefix(_MARK))]


def table_of(found: dict[str, list[BenchRow]]) -> str:
    """Return the table in Markdown."""
    lines = ["| what | today | goal | | `python -m benchmarks --only` |"]
    lines.append("|---|---|---|---|---|")
    lines += [
        f"| {' | '.join(row.cells())} | {name} |"
        for name, rows in found.items()
        for row in rows
    ]
    return "\n".join(lines)


def with_table(page: str, text: str) -> str:
    """Return the page with `text` between its marks.

    Raises:
        ValueError: the page has no marks.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError("the page has no marks for the table")
    return f"{before}{BEGIN}\n{text}\n{END}{after}"


def main() -> int:
    """Run, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.name}")
    parser.add_argument("--inside", choices=NAMES, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.inside:
        rows = importlib.import_module(f"benchmarks.{arguments.inside}").rows()
        print(_MARK + json.dumps([row.plain() for row in rows]))
        return 0
    found: dict[str, list[BenchRow]] = {}
    for name in arguments.only:
        found[name] = run_one(name)
        for row in found[name]:
            print("  ".join(row.cells()), flush=True)
    text = f"\n{surroundings(PEERS)}\n\n{table_of(found)}\n"
    print(text)
    if arguments.write:
        PAGE.write_text(with_table(PAGE.read_text(), text))
    return 0


if __name__ == "__main__":
    sys.exit(main())
