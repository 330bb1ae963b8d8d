"""traction verify: hold kept trials against the checksums of the journal."""

import argparse

EXAMPLES = """\
  traction verify S012                      the kept trials of one session
  traction verify --all --json              every session, for a program"""

_NOT_AS_KEPT = 6  # exit code


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `verify`."""
    parser.add_argument(
        "sessions", nargs="*", metavar="SESSION", help="id, folder name or path"
    )
    parser.add_argument("--all", action="store_true", help="every session")
    parser.add_argument("--json", action="store_true", help="as JSON")


def run(args: argparse.Namespace) -> int:
    """Name every kept trial that is missing or changed; return the exit code."""
    import json
    from dataclasses import asdict

    from acquisition import SessionError
    from experiments.operator import BAD, GOOD, Console
    from experiments.session import compare_kept, find_session, list_sessions

    if bool(args.sessions) == args.all:
        raise SessionError(
            "Name the sessions to verify, or use --all.",
            hint="For example: traction verify S012",
        )
    sessions = list_sessions(args.data)
    if not args.all:
        names = dict.fromkeys(args.sessions)
        sessions = [find_session(args.data, name) for name in names]
    console = Console(color=not args.no_color)
    deviations = [d for session in sessions for d in compare_kept(session)]
    if args.json:
        console.say(json.dumps([asdict(d) for d in deviations], indent=1))
        return _NOT_AS_KEPT if deviations else 0
    for deviation in deviations:
        console.problem(f"{BAD} {deviation.text()}.")
    if not deviations:
        console.say(f"{GOOD} {len(sessions)} sessions: every kept trial is as kept.")
    return _NOT_AS_KEPT if deviations else 0
