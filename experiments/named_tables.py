"""Load tables as described by the options of a command."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from analysis.data.series import TractionSeries
from analysis.data.terrain_kinds import parse_stones
from analysis.tables.columns import (
    parse_columns,
    parse_lines,
    parse_names,
    parse_separator,
    parse_units,
)
from analysis.tables.loading import load_tables


def load_named_tables(
    args: argparse.Namespace,
    files: Sequence[Path],
    inputs: Sequence[str] = (),
    stones: str | None = None,
) -> dict[str, list[TractionSeries]]:
    """Read tables as `experiments.arguments.add_table_options` describes them.

    Args:
        args: options of the command line.
        files: the tables.
        inputs: further numeric columns.
        stones: size of the stones by terrain, from `--stones`.

    Raises:
        SettingsError: an option is invalid, or a table does not fit the options.
    """
    return load_tables(
        files,
        columns=parse_columns(args.columns) if args.columns else None,
        terrain=args.terrain,
        stones=parse_stones(stones) if stones else None,
        units=parse_units(args.unit) if args.unit else None,
        rate=args.rate,
        negate=parse_names(args.negate) if args.negate else (),
        inputs=inputs,
        separator=parse_separator(args.sep),
        decimal=args.decimal,
        skipped=parse_lines(args.skip) if args.skip else frozenset(),
    )
