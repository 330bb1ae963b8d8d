"""Run all benchmarks and print one table: measurement, value, goal, verdict.

    python -m benchmarks [--only NAME ...]

The benchmarks run one after the other, each in its own process, with the program's
linear-algebra settings.
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
    """Run one benchmark in its own process and return its rows."""
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


def table_of(rows_by_name: dict[str, list[BenchRow]]) -> str:
    """Return the results as a Markdown table."""
    lines = ["| what | measured | goal | | `python -m benchmarks --only` |"]
    lines.append("|---|---|---|---|---|")
    lines += [
        f"| {' | '.join(row.cells())} | {name} |"
        for name, rows in rows_by_name.items()
        for row in rows
    ]
    return "\n".join(lines)


def main() -> int:
    """Run the selected benchmarks and print their rows and the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--inside", choices=NAMES, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.inside:
        rows = importlib.import_module(f"benchmarks.{arguments.inside}").rows()
        print(_MARK + json.dumps([row.plain() for row in rows]))
        return 0
    rows_by_name: dict[str, list[BenchRow]] = {}
    for name in arguments.only:
        rows_by_name[name] = run_one(name)
        for row in rows_by_name[name]:
            print("  ".join(row.cells()), flush=True)
    print(f"\n{surroundings(PEERS)}\n\n{table_of(rows_by_name)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
