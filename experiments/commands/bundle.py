"""traction bundle: a session's small files, its logs and versions in one archive."""

import argparse
from pathlib import Path

from acquisition.wording import counted

EXAMPLES = """\
  traction bundle S012                      S012.bundle.zip in this folder
  traction bundle S012 bus.log              a log of the bus with it"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `bundle`."""
    parser.add_argument("session", metavar="SESSION", help="S012 or a folder")
    parser.add_argument(
        "others",
        nargs="*",
        type=Path,
        metavar="FILE",
        help="further files, such as a bus log or the log of a bug",
    )
    parser.add_argument(
        "--to", type=Path, metavar="FILE", help="the bundle (SESSION.bundle.zip)"
    )


def run(args: argparse.Namespace) -> int:
    """Write the bundle and print what it contains and omits."""
    from acquisition.errors import SettingsError
    from experiments.export.bundle import write_bundle
    from experiments.operator.console import WARNING, Console
    from experiments.session.store import find_session

    folder = find_session(args.data, args.session)
    missing = [str(path) for path in args.others if not path.is_file()]
    if missing:
        raise SettingsError(
            f"There is no file {', '.join(missing)}.", hint="Nothing was written."
        )
    console = Console(color=not args.no_color)
    console.say(
        f"{WARNING} The bundle contains the names and notes of the people in this "
        "session. Pass it on only if they agree."
    )
    to = args.to or Path(f"{folder.id}.bundle.zip")
    contents = write_bundle(folder, to, args.others)
    for name, why in contents.left_out.items():
        console.say(f"{WARNING} left out: {name} ({why})")
    size = to.stat().st_size / 1e6
    console.say(f"{counted(len(contents.files), 'file')}, {size:.1f} MB: {to}")
    return 0
