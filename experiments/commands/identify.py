"""traction identify: probabilities of the terrains over time."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import add_table_options

if TYPE_CHECKING:
    from analysis.data.series import TractionSeries
    from analysis.terrains.verdict import Recognition, WindowEvidence
    from experiments.operator.console import Console

EXAMPLES = """\
  traction identify data/sessions/*/trials/T01.mcap --terrain-db terrains.json
  traction identify trials.npz --terrain-db terrains.json --samples 200 --json"""

_WINDOWS = (50, 100, 200)  # kept samples
_PER_SECOND = 100  # kept samples


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `identify`."""
    parser.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="trials, npz or CSV tables"
    )
    parser.add_argument(
        "--terrain-db",
        required=True,
        type=Path,
        metavar="FILE",
        help="terrain database, from traction export --terrain-db",
    )
    parser.add_argument(
        "--samples",
        type=int,
        choices=_WINDOWS,
        default=100,
        help="samples of motion per answer: 50, 100 (default) or 200 are 0.5, 1 or 2 s",
    )
    add_table_options(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Identify the terrain of every trial; returns the exit code."""
    import json
    from dataclasses import asdict

    from analysis.data.prepare import PrepareOptions, prepare_trial
    from analysis.terrains.database import load
    from analysis.terrains.verdict import recognise
    from experiments.operator.console import Console

    console = Console(color=not args.no_color)
    database = load(args.terrain_db)
    results: list[dict[str, object]] = []
    for series in _series(args):
        trial = prepare_trial(series, PrepareOptions())
        result = recognise(trial, database, args.samples)
        if args.json:
            content = None if result is None else asdict(result)
            results.append({"trial": series.name, "terrain": series.terrain})
            results[-1]["recognition"] = content
        else:
            _print(series, result, args.samples, console)
    if args.json:
        console.say(json.dumps(results, indent=1))
    return 0


def _series(args: argparse.Namespace) -> list[TractionSeries]:
    """Return the trials of all files, recordings and tables."""
    from analysis.data.load import load_trial
    from experiments.named_tables import load_named_tables

    recorded = [path for path in args.files if path.suffix == ".mcap"]
    tables = [path for path in args.files if path.suffix != ".mcap"]
    result = [load_trial(path).series() for path in recorded]
    if tables:
        by_terrain = load_named_tables(args, tables)
        result += [series for group in by_terrain.values() for series in group]
    return result


def _print(
    series: TractionSeries, result: Recognition | None, window: int, console: Console
) -> None:
    seconds = window / _PER_SECOND
    if result is None:
        console.say(f"{series.name}: under {seconds:g} s of motion; no answer.")
        return
    console.say(f"{series.name} ({series.terrain}), {seconds:g} s windows")
    rows = [
        [
            f"{moment.t:.1f} s",
            *(f"{p:.2f}" for p in moment.posterior),
            moment.best,
            _surface(moment),
        ]
        for moment in result.moments
    ]
    rows.append(
        ["whole", *(f"{p:.2f}" for p in result.posterior), result.best, result.surface]
    )
    console.table(["", *result.terrains, "answer", "surface"], rows)
    console.say(f"smallest error: {result.least_error}")


def _surface(moment: WindowEvidence) -> str:
    """Return flat, rocky or none, and the probability of rocky ground if known."""
    if moment.rocky is None:
        return moment.surface
    return f"{moment.surface} (rocky {moment.rocky:.2f})"
