"""traction init: write rig.toml and matrix.toml to be edited."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.operator.console import Console

EXAMPLES = """\
  traction init lab                         into lab/, made where it is missing
  traction init lab --ask                   a matrix of your own, by a few questions"""

_FILES = ("rig.toml", "matrix.toml")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `init`."""
    parser.add_argument(
        "folder", nargs="?", type=Path, default=Path(), metavar="DIR", help="where (.)"
    )
    source = parser.add_mutually_exclusive_group()
    source.add_argument(
        "--ask", action="store_true", help="ask what is to be found out"
    )
    source.add_argument(
        "--from",
        dest="old",
        type=Path,
        metavar="FILE",
        help="rig.toml whose matrix.toml is written in the newer form, with factors",
    )


def run(args: argparse.Namespace) -> int:
    """Write both files, or neither where one is there already."""
    from acquisition.errors import SettingsError
    from experiments.operator.console import Console
    from experiments.session.data_files import write_new_text

    folder: Path = args.folder
    there = [str(folder / name) for name in _FILES if (folder / name).exists()]
    if there:
        raise SettingsError(
            f"{' and '.join(there)} exists already.",
            hint="Name another folder; nothing is ever overwritten.",
        )
    console = Console(color=not args.no_color)
    texts = _texts(args, console)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SettingsError(
            f"{folder} cannot be made ({error.strerror}).", hint="Nothing was written."
        ) from error
    for name, text in zip(_FILES, texts, strict=True):
        write_new_text(folder / name, text)
        console.say(f"wrote {folder / name}")
    config = folder / _FILES[0]
    console.say(f"Edit both, then: traction check --config-only --config {config}")
    return 0


def _texts(args: argparse.Namespace, console: "Console") -> tuple[str, str]:
    """Return the texts of both files."""
    from experiments.settings.load import load_settings
    from experiments.settings.writing import version_2_of

    if args.old is not None:
        old = load_settings(args.old)
        return old.rig_text, version_2_of(old.matrix)
    shipped = load_settings(None)
    if args.ask:
        return _asked(shipped.rig_text, list(shipped.rig.feet), console)
    return shipped.rig_text, shipped.matrix_text


def _asked(rig: str, feet: list[str], console: "Console") -> tuple[str, str]:
    """Return both files as a person answers.

    Raises:
        SettingsError: nobody answers, or the answers make no matrix.
    """
    from acquisition.errors import SettingsError
    from experiments.settings.asking import ask_design
    from experiments.settings.load import load_matrix, load_rig
    from experiments.settings.writing import feet_text, matrix_text, places_text

    def ask(question: str) -> str:
        console.say(question)
        line = sys.stdin.readline()
        if not line:
            raise SettingsError(
                "The questions were not answered.", hint="Nothing was written."
            )
        return line

    asked = ask_design(ask, console.say)
    new_feet = [name for name in asked.feet if name not in feet]
    rig += feet_text(new_feet) + places_text(asked.inclines)
    matrix = matrix_text(asked)
    cells = load_matrix(matrix, load_rig(rig, _FILES[0], Path())).terrains
    console.say(f"{len(cells)} cells: {', '.join(row.name for row in cells[:6])} ...")
    return rig, matrix
