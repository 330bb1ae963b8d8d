"""traction verdict: change the verdict on a recorded trial."""

import argparse

from experiments.arguments import add_author_option

EXAMPLES = """\
  traction verdict S012 T04 reject "foot tilted"   T04 goes to rejected/
  traction verdict S012 T04a keep "it was fine"    back to trials/ as T04"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `verdict`."""
    parser.add_argument("session", metavar="SESSION", help="S012 or a folder")
    parser.add_argument("trial", metavar="TRIAL", help="T04, or T04a of rejected/")
    parser.add_argument("verdict", choices=("keep", "reject"), help="the new verdict")
    parser.add_argument(
        "reason", nargs="+", metavar="REASON", help="reason for the journal"
    )
    add_author_option(parser)


def run(args: argparse.Namespace) -> int:
    """Change the verdict in the journal and the files; the history is kept."""
    from experiments.operator.console import Console
    from experiments.session.annotations import change_verdict
    from experiments.session.store import find_session

    folder = find_session(args.data, args.session)
    reason = " ".join(args.reason)
    lines = change_verdict(folder, args.trial, args.verdict, reason, args.operator)
    console = Console(color=not args.no_color)
    for line in lines:
        console.say(line)
    return 0
