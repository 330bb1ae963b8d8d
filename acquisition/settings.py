"""Field types and parser of settings and calibrations in TOML."""

import io
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, cast

from pydantic import BaseModel, ConfigDict, Field

from acquisition.files import NotRegularError, UnfitFileError, read_regular

# strict: a number in quotes, or `true`, is an error
Number = Annotated[float, Field(strict=True)]
Whole = Annotated[int, Field(strict=True)]
Near = Annotated[Number, Field(ge=-10, le=10)]  # m or rad
Six = tuple[Number, Number, Number, Number, Number, Number]
File = Annotated[str, Field(min_length=1, max_length=4096)]  # next to rig.toml


@dataclass(frozen=True, slots=True)
class UsualRange:
    """Unit and usual range of a number, in addition to its bounds.

    Attributes:
        low: smallest value without a warning.
        high: largest value without a warning.
        unit: unit; "" = none.
        real: largest value on a real arm; None = the field's bound. Simulated devices
            may be late on a busy computer and need more.
    """

    low: float
    high: float
    unit: str = ""
    real: float | None = None


_DEEPEST = 20  # nesting levels; a settings file has four
# tomllib's memory use is quadratic in the length of a dotted key
_PARTS = re.compile(r"[,=\n]")
_DOTTED = re.compile(r"""\.\s*[\w"'-]""")
_LARGEST_WHOLE = 2**63 - 1  # of TOML
_LARGEST = 1_000_000  # bytes; a hand-written file has a few thousand


def read_text(path: Path) -> str:
    """Return the text of a small UTF-8 file, without a byte-order mark.

    Pipes and devices are not opened.

    Raises:
        OSError: the file cannot be read.
        ValueError: not a regular file, larger than 1 MB, or not UTF-8.
    """
    try:
        data = read_regular(path, _LARGEST, is_link_followed=True)
        return io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig").read()
    except NotRegularError as error:
        raise ValueError("it is not a file") from error
    except UnfitFileError as error:
        raise ValueError(f"it {error}") from error
    except UnicodeDecodeError as error:
        raise ValueError("it is not text") from error


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML.

    tomllib accepts integers of any size; here they are limited to the 64 bits of TOML,
    which arrays and messages can hold.

    Raises:
        ValueError: invalid TOML, too deep nesting, or an integer beyond 64 bits.
    """
    if any(len(_DOTTED.findall(part)) > _DEEPEST for part in _PARTS.split(text)):
        raise ValueError("it nests too deeply")
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except (ValueError, RecursionError) as error:
        what = "nests too deeply" if isinstance(error, RecursionError) else _TOO_LARGE
        raise ValueError(f"it {what}") from error
    level: list[object] = [table]
    for _ in range(_DEEPEST):
        level = [inner for value in level for inner in _children(value)]
        if any(type(v) is int and abs(v) > _LARGEST_WHOLE for v in level):
            raise ValueError(f"it {_TOO_LARGE}")
    if any(isinstance(value, dict | list) for value in level):
        raise ValueError("it nests too deeply")
    return table


_TOO_LARGE = "has an integer beyond 64 bits"


def _children(value: object) -> list[object]:
    if isinstance(value, dict):
        return list(cast("dict[str, object]", value).values())
    return cast("list[object]", value) if isinstance(value, list) else []


class SettingsSection(BaseModel):
    """A table of a settings file: unknown keys and infinite numbers are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
