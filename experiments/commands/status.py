"""traction status: the matrix board."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from experiments.operator import Console
    from experiments.session import MatrixRow

EXAMPLES = """\
  traction status                           the board, and what comes next
  traction status --where kind=live,stones=big --follow   watch a part of it"""

_HEADER = ("terrain", "kind", "kept", "trials", "rejected", "sessions")
_LOOK_NS = 1_000_000_000
_NOT_AS_KEPT = 6  # exit code


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `status`."""
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.add_argument(
        "--where",
        default="",
        metavar="K=V,...",
        help="only these: terrain, stones, incline_deg, foot, kind, session, operator",
    )
    parser.add_argument(
        "--follow",
        action="store_true",
        help="print again on every change, until Ctrl-C",
    )


def run(args: argparse.Namespace) -> int:
    """Print the board, counted from files whose checksum is right."""
    import json

    from experiments.operator import BAD, Console
    from experiments.session import (
        DigestCache,
        board_notes,
        compare_board,
        count_board,
        enough_lines,
        next_steps,
        parse_where,
    )
    from experiments.settings import load_settings

    settings = load_settings(args.config)
    where, digest = parse_where(args.where), DigestCache()
    console = Console(color=not args.no_color)

    def count() -> list[MatrixRow]:
        return count_board(args.data, settings.matrix, where, digest)

    def steps(board: Sequence[MatrixRow]) -> list[str]:
        kinds = {line.is_simulated for line in board if line.sessions} or {False}
        every = enough_lines(args.data, settings.matrix, where)
        for kind in sorted(kinds):
            every += next_steps(args.data, settings.matrix, is_simulated=kind)
        return every

    def notes(board: Sequence[MatrixRow]) -> list[str]:
        return board_notes(args.data, settings.matrix, where, board)

    def lines() -> list[str]:
        return [*_plain(board := count()), *notes(board), *steps(board)]

    if args.follow:
        return _follow(lines, console)
    board = count()
    deviations = compare_board(args.data, where, digest)
    for note in notes(board):  # not in the way of a program that reads the board
        console.problem(note)
    if args.json:
        console.say(json.dumps([line.as_dict() for line in board], indent=1))
    else:
        _print(board, steps(board), console)
    for deviation in deviations:
        console.problem(f"{BAD} {deviation.text()}.")
    return _NOT_AS_KEPT if deviations else 0


def _print(board: Sequence[MatrixRow], steps: Sequence[str], console: Console) -> None:
    console.table(_HEADER, [_row(line) for line in board])
    for step in steps:
        console.say(step)


def _row(line: MatrixRow) -> tuple[str, ...]:
    return (
        line.terrain,
        "simulated" if line.is_simulated else "live",
        f"{line.kept}/{line.wanted}",
        line.cells(),
        str(line.rejected),
        " ".join(line.sessions) or "-",
    )


def _plain(board: Sequence[MatrixRow]) -> list[str]:
    """Return the board as lines of text."""
    rows = [_HEADER, *(_row(line) for line in board)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(_HEADER))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        for row in rows
    ]


def _follow(look: Callable[[], list[str]], console: Console) -> int:
    """Show what `look` returns whenever it has changed, until Ctrl-C."""
    from acquisition import SystemClock

    clock = SystemClock()
    shown: list[str] = []
    try:
        while not console.is_lost:
            lines = look()
            if lines != shown and console.is_live:
                console.panel(lines)
            elif lines != shown:
                for line in [*([""] if shown else []), *lines]:
                    console.say(line)
            shown = lines
            clock.sleep_until(clock.now_ns() + _LOOK_NS)
    except KeyboardInterrupt:
        pass
    console.end_panel()
    return 0
