"""Frictionless data packages: reading and writing `datapackage.json` with its tables.

A package lists every file with size and SHA-256, every column with unit and meaning,
and the terrain of every trial. A modified file is never read. The format is Data
Package 1.0 of https://specs.frictionlessdata.io; `unit` and `traction` are additional
properties, which other programs keep and ignore.
"""

import hashlib
import os
from collections.abc import Iterator, Sized
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, open_regular, read_regular
from acquisition.formats import format_problem
from acquisition.validation import Many, first_problem
from analysis.data.memory import share_of_memory
from analysis.data.recorded_factors import MAX_FACTORS, checked_factors
from analysis.data.terrain_kinds import Value

DESCRIPTOR = "datapackage.json"
_LARGEST = 16_000_000  # bytes always allowed for a descriptor; 80 trials take 2 million
_PARTS = 48  # fraction 1/48 of the free memory; parsing takes twenty times the size
_FILE = 3200  # least bytes of a descriptor per file
_ABSENT = ("", "NaN")  # cells without a value
_CHANGED = "Copy the file again, or read it alone, outside of its package."


class TableOrigin(BaseModel):
    """Origin of a table: session, trial, terrain and recording.

    Attributes:
        table: "trial" at the recorded rate, "kept" for the samples that models are
            fitted to, "index" or "dictionary".
        session: id of the session.
        trial: number of the trial, e.g. "T04".
        terrain: name of the terrain.
        stones: size of the stones; empty if not known.
        incline_deg: incline of the plane [degrees].
        factors: further properties of terrain and foot by name; None = does not apply.
        force_age: age of the forces relative to the joints [s].
        simulated: the devices were simulated.
        recording: SHA-256 of the recorded trial, or of the imported log.
        imported: imported from the log of another robot; see `import.json`.
        rig: name of that robot.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    table: Literal["trial", "kept", "index", "dictionary"]
    session: str = Field(default="", max_length=60)
    trial: str = Field(default="", max_length=60)
    terrain: str = ""
    stones: str = Field(default="", max_length=60)
    incline_deg: float | None = Field(default=None, ge=-90, le=90)
    factors: dict[str, Any] = Field(
        default_factory=dict[str, Any], max_length=MAX_FACTORS
    )
    force_age: float = Field(default=0.0, ge=-1, le=1)
    simulated: bool = False
    recording: str = Field(default="", max_length=64)
    imported: bool = False
    rig: str = Field(default="", max_length=200)

    @field_validator("factors")
    @classmethod
    def _are_factors(cls, values: dict[str, Any]) -> dict[str, Value]:
        return checked_factors(values)

    @property
    def name(self) -> str:
        """Session and trial, e.g. S012/T04."""
        return f"{self.session or '?'}/{self.trial or '?'}"


class PackageField(BaseModel):
    """One column of a table.

    Attributes:
        name: name in the header of the file.
        type: "number", "integer", "boolean" or "string".
        unit: unit; "" for text.
        description: meaning.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    name: str
    type: str
    unit: str = ""
    description: str = ""


class TableSchema(BaseModel):
    """The columns of a table.

    Attributes:
        fields: columns in the order of the file.
        missingValues: cell contents that mean no value.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    fields: Many[PackageField]
    missingValues: Many[str] = _ABSENT


class PackageFile(BaseModel):
    """One file of a package.

    Attributes:
        name: unique name in lower case.
        profile: profile of the Frictionless standard.
        path: path relative to the package.
        format: "csv" or "parquet".
        mediatype: media type of the format.
        encoding: text encoding.
        bytes: size of the file.
        hash: "sha256:" and the digest of the file.
        description: meaning of the rows.
        table: columns.
        traction: origin of the table.
    """

    model_config = ConfigDict(frozen=True, extra="ignore", populate_by_name=True)

    name: str
    profile: str = "tabular-data-resource"
    path: str = Field(max_length=1000)
    format: Literal["csv", "parquet"]
    mediatype: str
    encoding: str = "utf-8"
    bytes: int = Field(ge=0)
    hash: str = Field(pattern=r"^sha256:[0-9a-f]{64}$")
    description: str = ""
    table: TableSchema = Field(alias="schema")
    traction: TableOrigin | None = None


class DataPackage(BaseModel):
    """The content of `datapackage.json`.

    Attributes:
        name: name in lower case.
        title: title.
        description: origin of the tables.
        created: time in UTC, as text.
        version: format version of the tables; None = written by another program.
        profile: profile of the Frictionless standard.
        resources: the files.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    name: str
    title: str = ""
    description: str = ""
    created: str = ""
    version: str | None = None
    profile: str = "tabular-data-package"
    resources: Many[PackageFile]

    @model_validator(mode="after")
    def _is_read(self) -> Self:
        is_own = any(file.traction is not None for file in self.resources)
        if is_own and (problem := format_problem(self.version)):
            raise ValueError(f"it {problem}")
        return self

    @field_validator("resources", mode="before")
    @classmethod
    def _are_not_too_many(cls, files: object) -> object:
        most = _largest() // _FILE
        if isinstance(files, Sized) and len(files) > most:
            raise ValueError(f"{len(files)} files, the most are {most} by free memory")
        return files

    def text(self) -> str:
        """Serialise the package as JSON."""
        return self.model_dump_json(by_alias=True, exclude_none=True, indent=1) + "\n"


@dataclass(frozen=True, slots=True)
class PackagedTable:
    """A table of a package on disk.

    Attributes:
        path: the file.
        entry: its entry in the package.
    """

    path: Path
    entry: PackageFile

    @property
    def origin(self) -> TableOrigin:
        """Origin of the table; an unnamed trial if the package states none."""
        return self.entry.traction or TableOrigin(table="trial")

    def check(self) -> None:
        """Check size and digest of the file.

        Raises:
            SettingsError: the file is missing, not a regular file, or modified.
        """
        try:
            with open_regular(self.path) as file:
                size = os.fstat(file.fileno()).st_size
                if size != self.entry.bytes:
                    raise self._changed(f"{size} bytes", self.entry.bytes)
                digest = hashlib.file_digest(file, "sha256").hexdigest()
        except UnfitFileError as error:
            raise SettingsError(f"{self.path}: it {error}.") from error
        except OSError as error:
            raise SettingsError(
                f"{self.path}: cannot be read ({error.strerror}).",
                hint=f"{DESCRIPTOR} names it. Was the folder copied completely?",
            ) from error
        if f"sha256:{digest}" != self.entry.hash:
            raise self._changed(f"SHA-256 {digest[:12]}...", self.entry.hash[7:19])

    def _changed(self, now: str, before: object) -> SettingsError:
        text = f"{self.path}: is changed: {now}, {DESCRIPTOR} states {before}."
        return SettingsError(text, hint=_CHANGED)


def is_package(path: Path) -> bool:
    """Return whether `path` is a folder or the descriptor of a package."""
    return path.is_dir() or path.name == DESCRIPTOR


def packaged_tables(path: Path) -> Iterator[PackagedTable]:
    """Yield every table of a package without opening the files.

    Args:
        path: `datapackage.json` or its folder.

    Raises:
        SettingsError: there is no valid package, or it points outside its folder.
    """
    descriptor = path / DESCRIPTOR if path.is_dir() else path
    for entry in _read(descriptor).resources:
        relative = PurePosixPath(entry.path)
        if relative.is_absolute() or ".." in relative.parts or "\\" in entry.path:
            raise SettingsError(
                f"{descriptor}: {entry.path[:60]!r} points outside the folder.",
                hint="Nothing was read.",
            )
        file = descriptor.parent / relative
        _check_folders(descriptor.parent, file)
        yield PackagedTable(file, entry)


def packaged_table(path: Path) -> PackagedTable | None:
    """Find the entry of a file in the package in its folder or the parent folder.

    Raises:
        SettingsError: a package exists but cannot be read.
    """
    for folder in (path.parent, path.parent.parent):
        if (folder / DESCRIPTOR).is_file():
            for table in packaged_tables(folder):
                if table.path == path:
                    return table
    return None


@lru_cache(maxsize=2)  # a pattern of a thousand tables needs it a thousand times
def _read_once(path: Path, _changed_ns: int, _size: int) -> DataPackage:
    return DataPackage.model_validate_json(read_regular(path, _largest()))


def _largest() -> int:
    """Return the size limit of a descriptor by the free memory [bytes]."""
    return share_of_memory(_PARTS, _LARGEST)


def _check_folders(top: Path, file: Path) -> None:
    for folder in file.parents:
        if folder == top:
            return
        if folder.is_symlink():
            raise SettingsError(
                f"{folder} is a symbolic link.",
                hint="A data package is not read through a link.",
            )


def _read(path: Path) -> DataPackage:
    try:
        status = path.lstat()
        return _read_once(path, status.st_mtime_ns, status.st_size)
    except UnfitFileError as error:
        raise SettingsError(f"{path}: it {error}.") from error
    except OSError as error:
        raise SettingsError(
            f"{path}: cannot be read ({error.strerror}).",
            hint="Give the tables themselves, or a folder of traction export. Names of "
            "folders such as terrain=S0 are not read: --terrain states it.",
        ) from error
    except ValidationError as error:
        raise SettingsError(
            f"{path}: it is not a data package of tables ({first_problem(error)}).",
            hint="Make it with: traction export SESSION --to DIR.",
        ) from error
