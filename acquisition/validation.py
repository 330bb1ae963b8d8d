"""Field types for lists and tables of untrusted files, and error messages.

A file of a few megabytes can hold a million invalid values, and pydantic stores a
kilobyte for each. These lists stop at the first error, and these tables have a limited
number of keys.
"""

from collections.abc import Sized
from typing import Annotated, TypeVar

from pydantic import BeforeValidator, FailFast, ValidationError

_MOST_KEYS = 200
_LONGEST_KEY = 60  # in a message

_K = TypeVar("_K")
_V = TypeVar("_V")


def _limit_keys(table: object) -> object:
    if isinstance(table, Sized) and len(table) > _MOST_KEYS:
        raise ValueError(f"{len(table)} entries, the most are {_MOST_KEYS}")
    return table


Many = Annotated[tuple[_V, ...], FailFast()]
Entries = Annotated[dict[_K, _V], BeforeValidator(_limit_keys)]


def first_problem(error: ValueError) -> str:
    """Return location and text of the first problem in a file."""
    if not isinstance(error, ValidationError):
        return str(error)
    first = error.errors(include_url=False, include_input=False)[0]
    location = ".".join(_printable(part) for part in first["loc"])
    if first["type"] == "missing":
        return f"{location} is missing"
    what = first["msg"].removeprefix("Value error, ")
    if first["type"] in {"model_type", "dataclass_type"}:
        what = "Input should be a table"
    return f"{location}: {what}" if location else what


def _printable(part: int | str) -> str:
    """Return a part of a location with control characters escaped, shortened."""
    text = str(part)
    return (text if text.isprintable() else ascii(text))[:_LONGEST_KEY]
