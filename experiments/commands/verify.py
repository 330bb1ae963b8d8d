"""traction verify: verify kept trials, or a publication, by their checksums."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.wording import counted

if TYPE_CHECKING:
    from experiments.operator.console import Console
    from experiments.session.store import SessionFolder

EXAMPLES = """\
  traction verify S012                      the kept trials of one session
  traction verify crate --rebuild           a publication; its results computed again"""

_NOT_AS_KEPT = 6  # exit code
_SHOWN = 10  # differences of a rebuild


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `verify`."""
    parser.add_argument(
        "sessions",
        nargs="*",
        metavar="SESSION",
        help="id, folder name or path; or a folder of traction publish",
    )
    parser.add_argument(
        "--rebuild",
        action="store_true",
        help="compute the table of results of a publication again and compare",
    )
    parser.add_argument("--all", action="store_true", help="every session")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Print every missing or changed kept trial; returns the exit code."""
    import json
    from dataclasses import asdict

    from acquisition.errors import SessionError
    from experiments.export.crate import is_publication
    from experiments.operator.console import BAD, GOOD, Console
    from experiments.session.kept_files import compare_kept, repeated_numbers
    from experiments.session.store import find_session, list_sessions

    if bool(args.sessions) == args.all:
        raise SessionError(
            "Name the sessions to verify, or use --all.",
            hint="For example: traction verify S012",
        )
    published = [Path(name) for name in args.sessions if is_publication(Path(name))]
    if published or args.rebuild:
        return _verify_published(published, args)
    sessions = list_sessions(args.data)
    if args.all:
        _require_any(args.data, sessions)
    else:
        names = dict.fromkeys(args.sessions)
        sessions = [find_session(args.data, name) for name in names]
    console = Console(color=not args.no_color)
    deviations = [d for session in sessions for d in compare_kept(session)]
    deviations += repeated_numbers(sessions).values()
    if args.json:
        console.say(json.dumps([asdict(d) for d in deviations], indent=1))
        return _NOT_AS_KEPT if deviations else 0
    for deviation in deviations:
        console.problem(f"{BAD} {deviation.text()}.")
    if not deviations:
        checked = counted(len(sessions), "session")
        console.say(f"{GOOD} {checked}: every kept trial is unchanged.")
    return _NOT_AS_KEPT if deviations else 0


def _require_any(data: Path, sessions: list[SessionFolder]) -> None:
    """Refuse success if no session, or not every one, was verified.

    Raises:
        KeptDataError: a session was renamed.
        SessionError: there is no session.
    """
    from acquisition.errors import SessionError
    from experiments.session.kept_files import KeptDataError
    from experiments.session.store import unnamed_sessions

    renamed = unnamed_sessions(data)
    if renamed:
        raise KeptDataError(
            f"{renamed[0]} holds a journal, and is not called like a session.",
            hint="Give it its name back, e.g. 2027-03-14_S012_TF.",
        )
    if not sessions:
        raise SessionError(
            f"There is no session in {data / 'sessions'}: nothing was verified.",
            hint="Name the folder of the data with --data.",
        )


def _verify_published(folders: list[Path], args: argparse.Namespace) -> int:
    """Print every changed file of a publication; returns the exit code."""
    import json
    from dataclasses import asdict

    from acquisition.errors import SessionError
    from experiments.export.publication_check import changed_publication
    from experiments.operator.console import BAD, GOOD, Console

    if len(folders) != 1 or len(args.sessions) != 1:
        raise SessionError(
            "Verify one publication at a time, without sessions.",
            hint="For example: traction verify crate --rebuild",
        )
    console = Console(color=not args.no_color)
    changes = changed_publication(folders[0])
    if args.json:
        console.say(json.dumps([asdict(change) for change in changes], indent=1))
    for change in [] if args.json else changes:
        console.problem(f"{BAD} {folders[0]}: {change.text()}.")
    if changes:
        return _NOT_AS_KEPT
    if not args.json:
        console.say(f"{GOOD} {folders[0]}: every file is unchanged.")
    return _rebuild(folders[0], console) if args.rebuild else 0


def _rebuild(folder: Path, console: Console) -> int:
    from experiments.export.rebuilding import TOLERANCE, rebuild
    from experiments.operator.console import BAD, GOOD

    result = rebuild(folder, console)
    for text in result.different[:_SHOWN]:
        console.problem(f"{BAD} {text}.")
    if result.different:
        console.problem(f"{len(result.different)} of {result.rows} results differ.")
        return _NOT_AS_KEPT
    console.say(
        f"{GOOD} {result.rows} results computed again: the largest relative difference "
        f"is {result.worst:.1e} (limit {TOLERANCE:.0e})."
    )
    return 0
