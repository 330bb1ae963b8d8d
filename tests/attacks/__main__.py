"""Print a table of attacks, or run its rows: `python -m tests.attacks TABLE [--run]`.

    python -m tests.attacks                          the names of the tables
    python -m tests.attacks faults                   its rows, in Markdown
    python -m tests.attacks pairs --run --jobs 2     runs all of them
    python -m tests.attacks faults --run --only estop
    python -m tests.attacks pairs --run --count 200 --seed 7
    python -m tests.attacks hazards                  reactions, measured bounds, hazards
    python -m tests.attacks --to DIR                 every table as a file

A row that fails is printed with its reason; the exit code is 1 if any did.
"""

import argparse
import random
import sys
import tempfile
import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path

from tests.attacks.attack import Attack
from tests.attacks.tables import TABLES
from tests.background import restore_signals
from tests.faults.printed import text

HAZARDS = "hazards"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print or run a table; the exit code."""
    options = _options().parse_args(arguments)
    if options.to is not None:
        for name in (*TABLES, HAZARDS):
            (options.to / f"{name}.txt").write_text(_table(name))
        return 0
    if options.table is None:
        _print("\n".join([*TABLES, HAZARDS]))
        return 0
    if options.table == HAZARDS:
        _print(_table(HAZARDS))
        return 0
    rows = _rows(options.table)
    numbers = [n for n, row in enumerate(rows) if options.only in str(row)]
    if options.count is not None:
        count = min(options.count, len(numbers))
        numbers = random.Random(options.seed).sample(numbers, count)
    numbers = numbers[options.skip :]
    if not options.run:
        _print("\n".join(markdown([rows[n] for n in numbers])))
        return 0
    restore_signals()
    failed = _run(options.table, numbers, options.jobs)
    return 1 if failed else 0


def _table(name: str) -> str:
    return text() if name == HAZARDS else "\n".join(markdown(TABLES[name]()))


def _options() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(
        prog="python -m tests.attacks",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    options.add_argument("table", nargs="?", choices=[*TABLES, HAZARDS])
    options.add_argument("--run", action="store_true", help="run the rows")
    options.add_argument("--only", default="", help="rows that contain this text")
    options.add_argument("--count", type=int, help="so many of them, drawn by --seed")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--skip", type=int, default=0, help="so many, run before")
    options.add_argument("--to", type=Path, metavar="DIR", help="write all tables")
    options.add_argument("--jobs", type=int, default=1, help="processes")
    return options


def markdown(rows: Sequence[Attack]) -> Iterator[str]:
    """Lines of a table in Markdown."""
    yield "| what is done | when | what must hold | run by |"
    yield "| --- | --- | --- | --- |"
    for row in rows:
        cells = (row.done, row.when, row.holds, row.run_by)
        yield f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"
    yield f"\n{len(rows)} rows."


def _run(table: str, numbers: Sequence[int], jobs: int) -> int:
    """Run rows of a table; the number of failed ones."""
    failed = 0
    with ProcessPoolExecutor(jobs) as pool:
        outcomes = pool.map(_outcome, [table] * len(numbers), numbers)
        for done, (row, problem) in enumerate(outcomes, 1):
            if problem:
                failed += 1
                _print(f"{row}: {problem}")
            if done % 100 == 0:
                _print(f"{done} of {len(numbers)}, {failed} failed")
    _print(f"{len(numbers)} rows of {table}, {failed} failed")
    return failed


@cache
def _rows(table: str) -> Sequence[Attack]:
    return TABLES[table]()


def _outcome(table: str, number: int) -> tuple[str, str]:
    """Run one row in a process of the pool; its name and its problem."""
    row = _rows(table)[number]
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        try:
            row.check(Path(folder))
        except AssertionError as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            return str(row), f"{place.name}, line {place.lineno}: {error}"
        except Exception:
            return str(row), traceback.format_exc()
    return str(row), ""


def _print(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
