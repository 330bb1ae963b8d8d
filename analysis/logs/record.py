"""`import.json`: what a data package of imported trials was made from, and how."""

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
    """One file that was read.

    Attributes:
        what: "log", "urdf" or "tare".
        path: name of the file.
        bytes: its size.
        sha256: its digest.
    """

    what: _Text
    path: _Text
    bytes: int = Field(ge=0)
    sha256: str = Field(max_length=64)


class ImportedTopic(_Part):
    """One topic that was read.

    Attributes:
        what: "joints" or "wrench".
        name: of the topic.
        type: of its messages.
        frame_id: that its header names.
        times: "stamp" or "receipt".
        read: messages of the topic.
        used: of them that became readings.
        dropped: incomplete ones, and those with numbers that are not finite.
        repeated: with the time of another one.
        overtaken: that stood behind a later one.
        rate_by_stamp: [Hz].
        rate_by_receipt: [Hz].
        late_ms: receipt less stamp, median and at most [ms].
        longest_gap_ms: between two that are used [ms].
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
    """One thing that was stated, or that the log shows.

    Attributes:
        name: what it is.
        value: as stated, in `unit`; empty for what was not stated.
        unit: of the numbers.
        shown: by the log, in `unit`; empty where it shows nothing.
        spread: how well it is shown; `how` names its unit.
        how: by what it is shown, why it is not, or the limit of a check.
    """

    name: _Text
    value: Many[_Number] = Field(max_length=20)
    unit: _Text = ""
    shown: Many[_Number] = Field(default=(), max_length=20)
    spread: Many[_Number] = Field(default=(), max_length=20)
    how: _Text = ""


class ImportRecord(_Part):
    """The content of `import.json`.

    Attributes:
        format: of this file.
        version: of this form.
        log_format: of the log, in words.
        robot: name of the robot in its URDF.
        joints: between its base and the foot.
        is_estimated: the robot estimated the wrench.
        files: that were read.
        topics: that were read.
        arguments: of the command, by option.
        checks: what was stated beside what the log shows.
        trials: seconds of the log, by name of the trial.
        warnings: word for word.
        losses: what of the log could not be read.
        versions: of program and packages.
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
        """Return it as JSON."""
        return self.model_dump_json(indent=1) + "\n"


def read_record(folder: Path) -> ImportRecord | None:
    """Return what a folder says of its import; None where it says nothing.

    Raises:
        SettingsError: its `import.json` cannot be read.
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
            f"{path}: it is no record of an import ({first_problem(error)}).",
            hint="Make the package again: traction import LOG --to DIR.",
        ) from error
