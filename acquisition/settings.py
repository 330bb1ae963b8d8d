"""What settings and calibrations in TOML are made of, and how they are parsed."""

import io
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, cast

from pydantic import BaseModel, ConfigDict, Field

from acquisition.files import NotRegularError, UnfitFileError, read_regular

# strict: a number in quotes, or `true`, is a mistake and no number
Number = Annotated[float, Field(strict=True)]
Whole = Annotated[int, Field(strict=True)]
Near = Annotated[Number, Field(ge=-10, le=10)]  # metres and radians of this room
Six = tuple[Number, Number, Number, Number, Number, Number]
File = Annotated[str, Field(min_length=1, max_length=4096)]  # beside rig.toml


@dataclass(frozen=True, slots=True)
class Usual:
    """Beside the bounds of a number: its unit, and where it lies on a sound rig.

    Attributes:
        low: smallest that is not warned of.
        high: largest that is not warned of.
        unit: of the number; "" = none.
        real: largest on a real arm; None = that of the field. A busy computer makes
            simulated devices late.
    """

    low: float
    high: float
    unit: str = ""
    real: float | None = None


_DEEPEST = 20  # tables in tables; a settings file has four
# tomllib takes memory with the square of the length of a dotted key
_PARTS = re.compile(r"[,=\n]")
_DOTTED = re.compile(r"""\.\s*[\w"'-]""")
_LARGEST_WHOLE = 2**63 - 1  # of TOML
_LARGEST = 1_000_000  # bytes; what a person writes has a few thousand


def read_text(path: Path) -> str:
    """Return the UTF-8 text of a small file that a person or a calibration wrote.

    A byte-order mark, which some editors put before it, is left out.
    Pipes and devices are not opened: they would be read for ever.

    Raises:
        OSError: it cannot be read.
        ValueError: it is not a file, larger than 1 MB, or no text.
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
    """Return the table in `text`.

    Python would take integers of any size; TOML has none beyond 64 bits, and neither
    arrays nor messages can hold them.

    Raises:
        ValueError: the text is no TOML, nests too deeply, or has too large an integer.
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
        level = [inner for value in level for inner in _inner(value)]
        if any(type(v) is int and abs(v) > _LARGEST_WHOLE for v in level):
            raise ValueError(f"it {_TOO_LARGE}")
    if any(isinstance(value, dict | list) for value in level):
        raise ValueError("it nests too deeply")
    return table


_TOO_LARGE = "has an integer beyond 64 bits"


def _inner(value: object) -> list[object]:
    if isinstance(value, dict):
        return list(cast("dict[str, object]", value).values())
    return cast("list[object]", value) if isinstance(value, list) else []


class SettingsSection(BaseModel):
    """A table of a settings file: unknown keys and infinite numbers are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
