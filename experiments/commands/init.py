"""traction init: write rig.toml and matrix.toml for editing."""

import argparse
from pathlib import Path

EXAMPLES = """\
  traction init                             into this folder
  traction init lab                         into lab/, created if it is missing"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `init`."""
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        default=Path(),
        metavar="DIR",
        help="folder (default .)",
    )


def run(args: argparse.Namespace) -> int:
    """Write both files, or neither if one exists already."""
    from acquisition.errors import SettingsError
    from experiments.operator.console import Console
    from experiments.session.data_files import write_new_text
    from experiments.settings.load import load_settings

    folder: Path = args.folder
    shipped = load_settings(None)
    texts = {"rig.toml": shipped.rig_text, "matrix.toml": shipped.matrix_text}
    there = [str(folder / name) for name in texts if (folder / name).exists()]
    if there:
        raise SettingsError(
            f"{' and '.join(there)} exists already.",
            hint="Name another folder; nothing is ever overwritten.",
        )
    console = Console(color=not args.no_color)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SettingsError(
            f"{folder} cannot be made ({error.strerror}).", hint="Nothing was written."
        ) from error
    for name, text in texts.items():
        write_new_text(folder / name, text)
        console.say(f"wrote {folder / name}")
    config = folder / "rig.toml"
    console.say(f"Edit both, then: traction check --config-only --config {config}")
    return 0
