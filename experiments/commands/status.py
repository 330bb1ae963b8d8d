"""traction status: kept trials per terrain."""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import DEFAULT_DATA

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from experiments.operator.console import Console
    from experiments.session.kept_files import Deviation
    from experiments.session.status_table import MatrixRow
    from experiments.session.store import SessionFolder
    from experiments.session.where import Where
    from experiments.settings.matrix import MatrixSettings

EXAMPLES = """\
  traction status                           the table, and what comes next
  traction status --where 'kind=live,incline_deg>5' --follow   watch a part of it"""

_HEADER = ("terrain", "kind", "kept", "trials", "rejected", "sessions")
_LOOK_NS = 1_000_000_000
_NOT_AS_KEPT = 6  # exit code
_NO_FOLDER = 2  # exit code


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `status`."""
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument(
        "--where",
        default="",
        metavar="K=V,...",
        help="only these: terrain, stones, incline_deg, push_deg, foot, place, kind, "
        "session, operator or a factor, with = != < <= > >=",
    )
    parser.add_argument(
        "--follow",
        action="store_true",
        help="print again on every change, until Ctrl-C",
    )


def run(args: argparse.Namespace) -> int:
    """Print the table, counted from files with the right checksum."""
    from experiments.operator.console import Console
    from experiments.session.status_table import (
        count_rows,
        facts_of_row,
        find_deviations,
        summarise_sessions,
    )
    from experiments.session.summaries import (
        Checksums,
        recorded_facts,
        summarise_all_unverified,
    )
    from experiments.session.upcoming import next_steps
    from experiments.session.where import check_values, parse_where
    from experiments.settings.load import load_settings

    matrix = load_settings(args.config).matrix
    digest = Checksums()
    where = parse_where(args.where, _factors(args, matrix))
    console = Console(color=not args.no_color)

    def look() -> StatusTable:
        seen = summarise_sessions(args.data, where, digest)
        lines = count_rows(seen, matrix, where)
        folders = [s.folder for s in seen]
        terrains = {row.name for row in matrix.terrains}
        kinds = {line.is_simulated for line in lines if line.sessions} or {False}
        steps: list[str] = []
        for kind in sorted(kinds):
            steps += next_steps(args.data, seen, matrix, where, is_simulated=kind)
        notes = table_notes(args.data, folders, terrains, where, lines)
        return StatusTable(lines, notes, steps, find_deviations(seen, where))

    if where:
        seen = summarise_all_unverified(args.data)
        facts = [facts_of_row(row) for row in matrix.terrains]
        facts += [s.facts | recorded_facts(s.folder, where) for s in seen]
        check_values(where, [*facts, {"kind": "live"}, {"kind": "simulated"}])
    if args.follow:
        return _follow(lambda: look().plain(), console)
    code = _show(look(), console, is_json=args.json)
    is_misnamed = args.data != DEFAULT_DATA and not args.data.is_dir()
    return _NO_FOLDER if is_misnamed else code


@dataclass(frozen=True, slots=True)
class StatusTable:
    """Content of the status table.

    Attributes:
        lines: rows of the terrains.
        notes: reasons for missing rows or sessions.
        steps: next steps.
        deviations: kept trials that are missing or changed.
    """

    lines: list[MatrixRow]
    notes: list[str]
    steps: list[str]
    deviations: list[Deviation]

    def plain(self) -> list[str]:
        """Return the table as lines of text."""
        from experiments.operator.console import aligned

        table = aligned([_HEADER, *map(_row, self.lines)])
        return [*table, *self.notes, *self.steps]


def table_notes(
    data: Path,
    known: Sequence[SessionFolder],
    terrains: Collection[str],
    where: Where,
    lines: Sequence[object],
) -> list[str]:
    """Return a line for each reason why sessions or terrains are missing.

    Args:
        data: the data folder.
        known: its sessions.
        terrains: names of the terrains of the matrix.
        where: conditions of the table.
        lines: rows of the table.
    """
    from acquisition.trial_file.data_files import list_folder
    from experiments.session.store import JOURNAL_FILE

    sessions = data / "sessions"
    if not data.is_dir():
        return [f"There is no data folder {data}: nothing is counted."]
    if not sessions.is_dir():
        return [f"There are no sessions in {data} yet."]
    notes: list[str] = []
    named = {session.path for session in known}
    for path in list_folder(sessions):
        if path not in named and (path / JOURNAL_FILE).is_file():
            notes.append(
                f"{path} has a journal, but not the name of a session: it is not "
                "counted. Give it back its name."
            )
    notes += [
        f"{session.path.name}: {session.terrain} is not a terrain of the matrix; it is "
        "not counted."
        for session in known
        if session.terrain not in terrains
    ]
    if where and not lines:
        notes.append(f"Nothing matches --where {where}.")
    return notes


def _show(table: StatusTable, console: Console, *, is_json: bool) -> int:
    """Print the table; returns the exit code."""
    from experiments.operator.console import BAD

    for note in table.notes:  # to stderr: stdout may be read by a program
        console.problem(note)
    if is_json:
        console.say(json.dumps([line.as_dict() for line in table.lines], indent=1))
    else:
        console.table(_HEADER, [_row(line) for line in table.lines])
        for step in table.steps:
            console.say(step)
    for deviation in table.deviations:
        console.problem(f"{BAD} {deviation.text()}.")
    return _NOT_AS_KEPT if table.deviations else 0


def _factors(args: argparse.Namespace, matrix: MatrixSettings) -> list[str]:
    """Return the factors of the matrix, and of sessions if conditions name one."""
    from experiments.session.store import list_sessions
    from experiments.session.summaries import recorded_factors

    names = dict.fromkeys(name for row in matrix.terrains for name in row.factors)
    if args.where:
        for folder in list_sessions(args.data):
            names |= dict.fromkeys(recorded_factors(folder))
    return list(names)


def _row(line: MatrixRow) -> tuple[str, ...]:
    return (
        line.terrain,
        "simulated" if line.is_simulated else "live",
        f"{line.kept}/{line.wanted}",
        line.cells(),
        str(line.rejected),
        " ".join(line.sessions) or "-",
    )


def _follow(look: Callable[[], list[str]], console: Console) -> int:
    """Show the lines of `look` whenever they change, until Ctrl-C."""
    from acquisition.clock import SystemClock

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
