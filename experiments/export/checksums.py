"""Checksums of a folder: written for `sha256sum -c`, and verified."""

import hashlib
import os
import re
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import TrialFileError
from acquisition.files import open_regular, read_regular
from experiments.session.data_files import reading, write_new

SUMS = "SHA256SUMS"
_LINE = re.compile(r"(?P<digest>[0-9a-f]{64})  (?P<path>[^\0\n]{1,1000})")
_LARGEST = 16_000_000  # bytes of the list
_MOST = 100_000  # files in a folder tree


@dataclass(frozen=True, slots=True)
class ChangedFile:
    """One changed file of a folder.

    Attributes:
        path: path relative to the folder.
        problem: description of the fault.
    """

    path: str
    problem: str

    def text(self) -> str:
        """Return the change in one line."""
        return f"{self.path} {self.problem}"


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a regular file of any size; no link is followed.

    Raises:
        TrialFileError: `path` cannot be read, or is no regular file.
    """
    with reading(path), open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_sums(folder: Path) -> None:
    """Write the SHA-256 of every file below `folder`.

    Raises:
        TrialFileError: a file cannot be read, or the list exists already.
    """
    lines = [f"{digest_of(folder / name)}  {name}\n" for name in sorted(_files(folder))]
    write_new(folder / SUMS, "".join(lines).encode())


def changed_files(folder: Path) -> list[ChangedFile]:
    """Return every file below `folder` that is missing, changed or not in its list.

    Raises:
        TrialFileError: the list is missing or invalid.
    """
    listed = _read_sums(folder / SUMS)
    present = _files(folder) - {SUMS}
    changes: list[ChangedFile] = []
    for name in sorted(set(listed) | present):
        if name not in present:
            changes.append(ChangedFile(name, "is missing"))
        elif name not in listed:
            changes.append(ChangedFile(name, f"is not in {SUMS}"))
        else:
            try:
                if digest_of(folder / name) != listed[name]:
                    changes.append(ChangedFile(name, "is changed"))
            except TrialFileError as error:
                changes.append(ChangedFile(name, error.reason))
    return changes


def _files(folder: Path) -> set[str]:
    """Return all files below a folder; links are not followed."""
    names: set[str] = set()
    for top, folders, files in os.walk(folder, followlinks=False):
        links = [name for name in folders if (Path(top) / name).is_symlink()]
        for name in (*files, *links):
            names.add(str((Path(top) / name).relative_to(folder)))
        if len(names) > _MOST:
            raise TrialFileError(folder, f"holds more than {_MOST} files")
    return names


def _read_sums(path: Path) -> dict[str, str]:
    with reading(path):
        text = read_regular(path, _LARGEST)
    sums: dict[str, str] = {}
    for number, line in enumerate(text.decode(errors="replace").splitlines(), 1):
        match = _LINE.fullmatch(line)
        if match is None or match["path"] in sums:
            raise TrialFileError(path, f"is changed: line {number} is not a checksum")
        sums[match["path"]] = match["digest"]
    return sums
