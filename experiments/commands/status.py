"""traction status: the matrix board."""

import argparse
from pathlib import Path

EXAMPLES = """\
  traction status                           the board
  traction status --data /srv/traction      of another data folder"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `status`."""
    parser.add_argument("--json", action="store_true", help="as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the board, counted from files whose checksum is right."""
    import json

    from experiments.board import count_board
    from experiments.console import Console
    from experiments.settings import load_settings

    settings = load_settings(args.config)
    board = count_board(Path(args.data), settings.matrix)
    console = Console(color=not args.no_color)
    if args.json:
        console.say(json.dumps([line.as_dict() for line in board], indent=1))
        return 0
    rows = [
        (
            line.terrain,
            "simulated" if line.is_simulated else "live",
            f"{line.kept}/{line.wanted}",
            "█" * line.kept + "·" * max(0, line.wanted - line.kept),
            str(line.rejected),
            " ".join(line.sessions) or "-",
        )
        for line in board
    ]
    console.table(("terrain", "kind", "kept", "trials", "rejected", "sessions"), rows)
    return 0
