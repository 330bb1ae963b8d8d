"""Opening of a log: a file, or a rosbag2 folder with one or more files."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from zlib import crc32

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, open_regular
from acquisition.trial_file.records import MAGIC as MCAP_MAGIC
from acquisition.trial_file.unpacking import ZSTD_MAGIC, DamageError, unpack_file
from analysis.logs import bag_log, sqlite_log
from analysis.logs.bag_log import BagLog
from analysis.logs.log_file import (
    LARGEST_LOG,
    LARGEST_PART,
    LARGEST_RATIO,
    LogFile,
    LogMessage,
    LogTopic,
    damaged,
    first_byte,
    too_large,
)
from analysis.logs.mcap_log import McapLog
from analysis.logs.sqlite_log import SqliteLog, wal_of

_SUFFIXES = (".mcap", ".db3", ".bag", ".mcap.zstd", ".db3.zstd")
_MOST_FILES = 200
_FORMATS = (
    "Give an .mcap, a folder or .db3 of rosbag2, or a ROS 1 .bag. Tables are read by: "
    "traction fit FILE."
)


@contextmanager
def open_log(path: Path) -> Iterator[LogFile]:
    """Open the log at `path`.

    Raises:
        SettingsError: the log is missing, unknown, too large or damaged.
    """
    files = _files(path)
    with tempfile.TemporaryDirectory(prefix="traction-import-") as scratch:
        logs = [_opened(file, Path(scratch) / f"{k}") for k, file in enumerate(files)]
        yield logs[0] if len(logs) == 1 else LogOfParts(path, files, logs)


class LogOfParts:
    """Several files of one log in sequence; implements `LogFile`."""

    def __init__(self, path: Path, files: list[Path], parts: list[LogFile]) -> None:
        self.path = path
        self._names = [file.name for file in files]  # unpacked parts have other paths
        self.format = f"{parts[0].format}, {len(parts)} files"
        self.losses: list[str] = []
        self.topics: dict[str, LogTopic] = {}
        self.unread: dict[str, str] = {}
        for part in parts:
            self.topics |= part.topics
            self.unread |= part.unread
        self.is_simulated = any(part.is_simulated for part in parts)
        self._parts = parts

    def messages(self, topics: Collection[str]) -> Iterator[LogMessage]:
        """Yield every message of `topics` in the order of the files.

        Raises:
            SettingsError: two files hold the same messages.
        """
        self.losses.clear()
        seen: dict[tuple[int, int], str] = {}
        for name, part in zip(self._names, self._parts, strict=True):
            digest = count = 0
            for message in part.messages(topics):
                digest = crc32(message.data, digest ^ message.received_ns & 0xFFFFFFFF)
                count += 1
                yield message
            self.losses += [f"{name}: {loss}" for loss in part.losses]
            first = seen.setdefault((digest, count), name)
            if count and first != name:
                raise damaged(
                    self.path,
                    f"{first} and {name} hold the same {count} messages: the "
                    "recording is duplicated",
                    "Give one of the two files.",
                )


def log_files(path: Path) -> list[Path]:
    """List the files of the log at `path`; raises SettingsError."""
    files = _files(path)
    wals = [wal_of(file) for file in files]
    return [*files, *(wal for wal in wals if first_byte(wal))]


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    try:
        names = sorted(p for p in path.iterdir() if p.name.endswith(_SUFFIXES))
    except OSError as error:
        raise damaged(path, f"cannot be read ({error.strerror})") from error
    if not names or len(names) > _MOST_FILES:
        raise SettingsError(
            f"{path}: {len(names) or 'no'} logs in this folder.", hint=_FORMATS
        )
    return names


def _opened(path: Path, scratch: Path) -> LogFile:
    file, start = path, _first_bytes(path)
    if start.startswith(ZSTD_MAGIC):
        _unpack_file(path, scratch)
        file, start = scratch, _first_bytes(scratch)
    if start.startswith(MCAP_MAGIC):
        return McapLog(path, file)
    if start.startswith(sqlite_log.MAGIC):
        return SqliteLog(path, file, scratch.with_suffix(".wal"))
    if start.startswith(bag_log.MAGIC):
        return BagLog(path, file)
    if start.startswith(b"#ROSBAG V1"):
        raise damaged(path, "a bag of format 1", "Convert it: rosbag migrate.")
    raise damaged(path, "not a known log format", _FORMATS)


def _first_bytes(path: Path) -> bytes:
    try:
        with open_regular(path, is_link_followed=True) as file:
            size = os.fstat(file.fileno()).st_size
            start = file.read(16)
    except UnfitFileError as error:
        raise damaged(path, f"it {error}", _FORMATS) from error
    except OSError as error:
        raise damaged(
            path, f"cannot be read ({error.strerror})", "Check the name."
        ) from error
    if size > LARGEST_LOG:
        raise too_large(path, size)
    return start


def _unpack_file(path: Path, scratch: Path) -> None:
    """Unpack a compressed file to `scratch`."""
    most = min(LARGEST_LOG, max(2**20, LARGEST_RATIO * path.stat().st_size))
    try:
        with (
            open_regular(path, is_link_followed=True) as packed,
            scratch.open("wb") as out,
        ):
            unpack_file(packed, out, most, LARGEST_PART)
    except DamageError as error:
        raise damaged(path, str(error)) from error
