"""The catalogue of messages, as patterns of the screen's text."""

import re
from string import Formatter

from experiments.messages import CATALOGUE

# Messages whose prompt needs a terminal; without one a hint takes its place.
NO_KEYS = {"crash", "mismatch", "unfinished"}


def pattern(name):
    """Regular expression of a message of the catalogue with any values filled in."""
    message = CATALOGUE[name]
    arm = f"ARM: {message.arm}." if message.arm else ""
    do = "" if name in NO_KEYS else message.do
    parts = [part for part in (message.what, arm, do) if part]
    return "".join(
        re.escape(text) + (".*" if open_ is not None else "")
        for text, open_, *_ in Formatter().parse(" ".join(parts))
    )
