"""The catalogue of messages, as it is seen on the screen."""

import re
from string import Formatter

from experiments.messages import CATALOGUE

# Asked at a prompt that is not there without a terminal; the hint takes its place.
NO_KEYS = {"crash", "mismatch", "unfinished"}


def pattern(name):
    """Return what the catalogue says as a regular expression, anything filled in."""
    message = CATALOGUE[name]
    arm = f"ARM: {message.arm}." if message.arm else ""
    do = "" if name in NO_KEYS else message.do
    parts = [part for part in (message.what, arm, do) if part]
    return "".join(
        re.escape(text) + (".*" if open_ is not None else "")
        for text, open_, *_ in Formatter().parse(" ".join(parts))
    )
