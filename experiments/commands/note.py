"""traction note: write a remark on a session or a trial."""

import argparse

from experiments.arguments import add_author_option

EXAMPLES = """\
  traction note S012 "heater on since noon"     on the session
  traction note S012 T04 "a stone was wedged"   on a trial"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `note`."""
    parser.add_argument("session", metavar="SESSION", help="S012 or a folder")
    parser.add_argument(
        "words",
        nargs="+",
        metavar="WORD",
        help="T04 or T04a where one trial is meant, then the remark",
    )
    add_author_option(parser)


def run(args: argparse.Namespace) -> int:
    """Write the note into the journal and the trial's sidecar."""
    from experiments.operator.console import Console
    from experiments.session.annotations import add_note, looks_like_trial
    from experiments.session.store import find_session

    folder = find_session(args.data, args.session)
    words: list[str] = args.words
    trial = words[0] if len(words) > 1 and looks_like_trial(words[0]) else ""
    text = " ".join(words[1:] if trial else words)
    text = add_note(folder, trial, text, args.operator)
    Console(color=not args.no_color).say(text)
    return 0
