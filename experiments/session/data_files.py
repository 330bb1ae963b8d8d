"""Read and replace the small files of a session, synced down to the directory."""

import hashlib
import json
import math
import os
import re
import zlib
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, cast

from acquisition.errors import SessionError, TrialFileError
from acquisition.files import (
    UnfitFileError,
    create_file,
    removed_at_error,
    replace_file,
)
from acquisition.formats import FORMAT, format_problem
from acquisition.trial_file.data_files import (
    check_absent,
    open_data,
    open_folder,
    read_data,
)

# Without either, a number is below 1e200 * 1e99.
_MAY_OVERFLOW = re.compile(rb"[eE]\+?[0-9]{3}|[0-9]{200}")


def read_json(path: Path) -> dict[str, Any]:
    """Return a JSON object, an empty one if the file is missing or damaged.

    Raises:
        TrialFileError: `path` is no regular file of this session, too large, or
            unreadable at present.
    """
    try:
        return parse_object(read_data(path)) or {}
    except OSError as error:
        check_absent(path, error)
        return {}


def parse_object(text: bytes) -> dict[str, Any] | None:
    """Return the JSON object in `text`; None if it is none or contains NaN."""
    # A call per number takes longer than all the rest.
    checked = _finite if _MAY_OVERFLOW.search(text) else None
    try:
        value: object = json.loads(
            text.decode("utf-8-sig"), parse_constant=_finite, parse_float=checked
        )
    except (ValueError, RecursionError):
        return None
    return cast("dict[str, Any]", value) if isinstance(value, dict) else None


def write_json(path: Path, value: Mapping[str, object]) -> None:
    """Replace `path` atomically: temporary file, fsync, rename.

    Raises:
        TrialFileError: the disk is full or unavailable.
    """
    write_text(path, json.dumps(value, indent=1, allow_nan=False))


def write_text(path: Path, text: str) -> None:
    """Replace `path` by `text`, as `write_json` does.

    Raises:
        TrialFileError: the disk is full or unavailable.
    """
    with writing(path), open_folder(path.parent) as folder:
        replace_file(folder, path.name, text.encode())
        os.fsync(folder)


def write_new_text(path: Path, text: str) -> None:
    """Write `text` into a new file at `path`, as `write_new` does."""
    write_new(path, text.encode())


def write_new(path: Path, content: bytes) -> None:
    """Write `content` into a new file at `path`; never replaces one.

    Raises:
        TrialFileError: `path` exists, or the disk is full or unavailable.
    """
    with writing(path), open_folder(path.parent) as folder:
        create_file(folder, path.name, content)
        with removed_at_error(folder, path.name):
            os.fsync(folder)


def make_empty(folder: Path) -> None:
    """Create the folder that a user names for output, or accept an empty one.

    Raises:
        SessionError: the folder is not empty.
        TrialFileError: the folder cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        is_empty = not any(folder.iterdir())
    except OSError as error:
        raise TrialFileError(folder, f"cannot be made ({error.strerror})") from error
    if not is_empty:
        raise SessionError(
            f"{folder} is not empty.",
            hint="Name a new folder; nothing is ever overwritten.",
        )


def move_file(source: Path, target: Path) -> None:
    """Give `source` the name `target` in another folder; never replaces a file.

    A move that a kill interrupted, so that the file has both names, is completed.

    Raises:
        TrialFileError: `target` exists, the disk is full or unavailable, or a path is
            no regular file of the session.
    """
    with (
        writing(target),
        open_folder(source.parent) as old,
        open_folder(target.parent) as new,
    ):
        os.close(open_data(source))
        if not _is_same(target, source):
            os.link(
                source.name,
                target.name,
                src_dir_fd=old,
                dst_dir_fd=new,
                follow_symlinks=False,
            )
            os.fsync(new)
        os.unlink(source.name, dir_fd=old)
        os.fsync(old)


def remove_file(path: Path) -> None:
    """Remove `path`, if it exists, and sync its directory.

    Raises:
        TrialFileError: the disk is full or unavailable.
    """
    with writing(path), open_folder(path.parent) as folder:
        with suppress(FileNotFoundError):
            os.unlink(path.name, dir_fd=folder)
        os.fsync(folder)


@contextmanager
def writing(path: Path) -> Generator[None, None, None]:
    """Convert errors of a full disk or an existing name into TrialFileError."""
    try:
        yield
    except FileExistsError as error:
        raise TrialFileError(
            path,
            "exists and is never overwritten",
            hint="Choose another name. Nothing that was kept is lost.",
        ) from error
    except OSError as error:
        raise TrialFileError(
            path,
            f"cannot be written ({error.strerror})",
            hint="Is the disk full? Nothing that was kept is lost.",
        ) from error


@contextmanager
def reading(path: Path) -> Generator[None, None, None]:
    """Convert errors of reading a file into TrialFileError."""
    try:
        yield
    except OSError as error:
        raise TrialFileError(path, f"cannot be read ({error.strerror})") from error
    except UnfitFileError as error:
        raise TrialFileError(path, str(error)) from error


def sha256_of(path: Path) -> str:
    """Return the hex digest of a file.

    Raises:
        TrialFileError: `path` is no regular file of the session, too large, or
            unreadable.
    """
    with reading(path), os.fdopen(open_data(path), "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _is_same(target: Path, source: Path) -> bool:
    try:
        return os.path.samestat(target.lstat(), source.lstat())
    except OSError:
        return False


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text:.20} is not a finite number")
    return number


_CRC, _NUMBER = "crc", "line"
_VERSION = "version"  # key of the first line
_CHECKED = re.compile(rb'^(?P<body>\{.+), "crc": "(?P<crc>[0-9a-f]{8})"\}$')


def journal_line(event: Mapping[str, object], number: int) -> bytes:
    """Encode `event` as a line with the CRC-32 of the line without it.

    Args:
        event: the event.
        number: line number in the file, from 1, written into the line so that lost
            lines are detected. The first line also states the version.
    """
    stated = {**event, _NUMBER: number}
    if number == 1:
        stated[_VERSION] = FORMAT
    body = json.dumps(stated, allow_nan=False).encode()
    crc = b', "%s": "%08x"}\n' % (_CRC.encode(), zlib.crc32(body))
    return body[:-1] + crc


def parse_journal(text: bytes) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the events of a journal, and the faults in its lines.

    Torn lines and lines of a wrong checksum are left out. A torn line is the trace of a
    kill and no fault.
    """
    events: list[dict[str, Any]] = []
    faults: list[str] = []
    is_numbered = True
    for number, line in enumerate(text.splitlines(), 1):
        event = _parse_numbered(line)
        if event is None:
            if is_numbered and parse_object(line) is not None:
                faults.append(f"has a wrong checksum in line {number}")
            continue
        stated = event.pop(_NUMBER, None)
        event.pop(_VERSION, None)
        events.append(event)
        if is_numbered and stated != number:
            was = f"line {stated}" if type(stated) is int else "of no number"
            faults.append(f"lacks lines or has others: line {number} was {was}")
            is_numbered = False  # the following ones are shifted, too
    return events, faults


def journal_problem(text: bytes) -> str:
    """Return why a journal of another version is refused; "" for version 1.0.

    A torn or changed first line gives no version.
    """
    first = text.partition(b"\n")[0]
    event = parse_object(first)
    if event is None or (_CRC in event and _parse_numbered(first) is None):
        return ""
    return format_problem(event.get(_VERSION))


def _parse_numbered(line: bytes) -> dict[str, Any] | None:
    event = parse_object(line)
    if event is None or _CRC not in event:
        return None
    checked = _CHECKED.match(line.strip())
    if checked is None or zlib.crc32(checked["body"] + b"}") != int(checked[_CRC], 16):
        return None
    del event[_CRC]
    return event
