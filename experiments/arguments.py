"""Arguments that more than one command takes; imports nothing slow."""

from argparse import ArgumentParser, ArgumentTypeError


def whole_number(text: str) -> int:
    """Return a seed from the command line.

    Raises:
        ArgumentTypeError: it is no whole number of at least 0.
    """
    if not (text.isascii() and text.isdigit() and len(text) <= 18):
        raise ArgumentTypeError(f"{text!r} - expected a whole number >= 0, e.g. 1")
    return int(text)


def add_seed(parser: ArgumentParser) -> None:
    """Declare the seed of the rows that a Gaussian process is trained on."""
    parser.add_argument(
        "--seed",
        type=whole_number,
        default=0,
        metavar="N",
        help="of the choice of points (0)",
    )
