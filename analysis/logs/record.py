"""`import.json`: provenance of a data package of imported trials."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, read_regular
from acquisition.validation import Entries, Many, first_problem

RECORD = "import.json"
_LARGEST = 1_000_000  # bytes
_Text = Annotated[str, Field(max_length=5000)]


def _or_nan(value: object) -> object:
    return math.nan if value is None else value


_Number = Annotated[float, BeforeValidator(_or_nan)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", ser_json_inf_nan="null")


class ImportedFile(_Part):
    """One file read by an import.

    Attributes:
        what: "log", "urdf" or "tare".
        path: name of the file.
        bytes: size.
        sha256: digest.
    """

    what: _Text
    path: _Text
    bytes: int = Field(ge=0)
    sha256: str = Field(max_length=64)


class ImportedTopic(_Part):
    """One topic read by an import.

    Attributes:
        what: "joints" or "wrench".
        name: name of the topic.
        type: type of its messages.
        frame_id: frame in its header.
        times: clock: "stamp" or "receipt".
        read: number of messages.
        used: number of used messages.
        dropped: incomplete messages and those with invalid numbers.
        repeated: messages with a duplicate time.
        overtaken: messages out of order.
        rate_by_stamp: rate by stamps [Hz].
        rate_by_receipt: rate by receipt [Hz].
        late_ms: receipt minus stamp, median and maximum [ms].
        longest_gap_ms: longest time between two used messages [ms].
    """

    what: _Text
    name: _Text
    type: _Text
    frame_id: _Text = ""
    times: Literal["stamp", "receipt"]
    read: int
    used: int
    dropped: int
    repeated: int
    overtaken: int
    rate_by_stamp: _Number
    rate_by_receipt: _Number
    late_ms: tuple[_Number, _Number]
    longest_gap_ms: _Number


class ImportedFigure(_Part):
    """Comparison of one stated quantity with the log.

    Attributes:
        name: name of the quantity.
        value: stated value in `unit`; empty if not stated.
        unit: unit of the values.
        shown: value from the log in `unit`; empty if unavailable.
        spread: uncertainty of that value; `how` names its unit.
        how: method, reason why there is no value, or limit of a check.
    """

    name: _Text
    value: Many[_Number] = Field(max_length=20)
    unit: _Text = ""
    shown: Many[_Number] = Field(default=(), max_length=20)
    spread: Many[_Number] = Field(default=(), max_length=20)
    how: _Text = ""


class ImportRecord(_Part):
    """Content of `import.json`.

    Attributes:
        format: format of this file.
        version: version of this format.
        log_format: format of the log in words.
        robot: name of the robot in its URDF.
        joints: joints between base and foot.
        is_estimated: the wrench was estimated by the robot.
        files: files read.
        topics: topics read.
        arguments: command-line arguments by option.
        checks: comparisons of the input with the log.
        trials: start and end [s of the log] by trial name.
        warnings: warnings, verbatim.
        losses: unreadable parts of the log.
        versions: versions of program and packages.
    """

    format: Literal["traction-import"] = "traction-import"
    version: Literal[1] = 1
    log_format: _Text
    robot: _Text
    joints: Many[_Text] = Field(max_length=500)
    is_estimated: bool
    files: Many[ImportedFile] = Field(max_length=500)
    topics: Many[ImportedTopic] = Field(max_length=10)
    arguments: Entries[str, _Text]
    checks: Many[ImportedFigure] = Field(max_length=50)
    trials: Annotated[dict[str, tuple[float, float]], Field(max_length=2000)]
    warnings: Many[_Text] = Field(max_length=5000)
    losses: Many[_Text] = Field(max_length=500)
    versions: Entries[str, _Text]

    def text(self) -> str:
        """Serialise the record as JSON."""
        return self.model_dump_json(indent=1) + "\n"


def read_record(folder: Path) -> ImportRecord | None:
    """Read the import record of a folder; None without one.

    Raises:
        SettingsError: `import.json` cannot be read.
    """
    path = folder / RECORD
    try:
        return ImportRecord.model_validate_json(read_regular(path, _LARGEST))
    except FileNotFoundError:
        return None
    except UnfitFileError as error:
        raise SettingsError(f"{path}: it {error}.") from error
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read ({error.strerror}).") from error
    except ValidationError as error:
        raise SettingsError(
            f"{path}: it is not a record of an import ({first_problem(error)}).",
            hint="Make the package again: traction import LOG --to DIR.",
        ) from error
