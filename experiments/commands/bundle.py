"""traction bundle: one file that tells others what happened in a session."""

import argparse
from pathlib import Path

EXAMPLES = """\
  traction bundle S012                      S012.bundle.zip in this folder
  traction bundle S012 --redact bus.log     a log of the bus with it, no names"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `bundle`."""
    parser.add_argument("session", metavar="SESSION", help="S012 or a folder")
    parser.add_argument(
        "others",
        nargs="*",
        type=Path,
        metavar="FILE",
        help="what belongs to it: a bus log, the log of a bug",
    )
    parser.add_argument(
        "--to", type=Path, metavar="FILE", help="the bundle (SESSION.bundle.zip)"
    )
    parser.add_argument(
        "--redact",
        action="store_true",
        help="hide names and notes; leave out what may hold them",
    )


def run(args: argparse.Namespace) -> int:
    """Write the bundle; say what is in it and what is not."""
    from acquisition.errors import SettingsError
    from experiments.operator.console import WARNING, Console
    from experiments.report.bundle import write_bundle
    from experiments.session.store import find_session

    folder = find_session(args.data, args.session)
    missing = [str(path) for path in args.others if not path.is_file()]
    if missing:
        raise SettingsError(
            f"There is no file {', '.join(missing)}.", hint="Nothing was written."
        )
    to = args.to or Path(f"{folder.id}.bundle.zip")
    contents = write_bundle(folder, to, args.others, is_redacted=args.redact)
    console = Console(color=not args.no_color)
    for name, why in contents.left_out.items():
        console.say(f"{WARNING} left out: {name} ({why})")
    size = to.stat().st_size / 1e6
    console.say(f"{len(contents.files)} files, {size:.1f} MB: {to}")
    console.say(f"It is shown by: traction replay --bundle {to}")
    return 0
