"""Arguments that more than one command takes; imports nothing slow."""

from argparse import ArgumentTypeError


def whole_number(text: str) -> int:
    """Return a seed from the command line.

    Raises:
        ArgumentTypeError: it is no whole number of at least 0.
    """
    if not (text.isascii() and text.isdigit() and len(text) <= 18):
        raise ArgumentTypeError(f"{text!r} - expected a whole number >= 0, e.g. 1")
    return int(text)
