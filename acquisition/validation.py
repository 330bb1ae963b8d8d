"""What models of files share: lists and tables that may be hostile, and what is wrong.

A file of a few megabytes can hold a million wrong values, and pydantic notes every one
of them in a kilobyte. In these lists it looks at none after the first, and these tables
have few keys.
"""

from collections.abc import Sized
from typing import Annotated, TypeVar

from pydantic import BeforeValidator, FailFast, ValidationError

_MOST_KEYS = 200
_LONGEST_KEY = 60  # in a message

_K = TypeVar("_K")
_V = TypeVar("_V")


def _few(table: object) -> object:
    if isinstance(table, Sized) and len(table) > _MOST_KEYS:
        raise ValueError(f"{len(table)} entries, the most are {_MOST_KEYS}")
    return table


Many = Annotated[tuple[_V, ...], FailFast()]
Entries = Annotated[dict[_K, _V], BeforeValidator(_few)]


def first_problem(error: ValueError) -> str:
    """Return what is wrong with a file; of several the first, and where."""
    if not isinstance(error, ValidationError):
        return str(error)
    first = error.errors(include_url=False, include_input=False)[0]
    location = ".".join(_shown(part) for part in first["loc"])
    if first["type"] == "missing":
        return f"{location} is missing"
    what = first["msg"].removeprefix("Value error, ")
    if first["type"] in {"model_type", "dataclass_type"}:
        what = "Input should be a table"
    return f"{location}: {what}" if location else what


def _shown(part: int | str) -> str:
    """Return a part of a location; a key of a hostile file is not printed as it is."""
    text = str(part)
    return (text if text.isprintable() else ascii(text))[:_LONGEST_KEY]
