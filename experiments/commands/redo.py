"""traction redo: record one trial of a session again."""

import argparse

from experiments.arguments import add_reopening_options

EXAMPLES = """\
  traction redo S012 T04                    trial 4 again, the old one to rejected/
  traction redo S012 4 --reason "bed was wet"   with a reason for the journal"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `redo`."""
    parser.add_argument("session", metavar="SESSION", help="S012 or a folder")
    parser.add_argument("trial", metavar="TRIAL", help="T04 or 4")
    parser.add_argument(
        "--reason", default="", metavar="TEXT", help="reason for the journal"
    )
    add_reopening_options(parser)


def run(args: argparse.Namespace) -> int:
    """Record the trial; returns the exit code."""
    from acquisition.errors import SessionError
    from experiments.run.resume import redo, resume_request
    from experiments.session.annotations import clean_text, parse_trial
    from experiments.session.store import find_session

    folder = find_session(args.data, args.session)
    number, attempt = parse_trial(args.trial)
    if attempt:
        raise SessionError(
            f"{args.trial} is one attempt; a trial is repeated by its number.",
            hint=f"For example: traction redo {folder.id} T{number:02d}",
        )
    reason = clean_text(args.reason) if args.reason else "redone"
    return redo(folder, number, reason, resume_request(args))
