"""rosbag2 logs in SQLite (.db3), opened read-only without views or triggers."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

from acquisition.errors import SettingsError
from acquisition.trial_file.unpacking import ZSTD_MAGIC, DamageError
from analysis.logs.log_file import (
    LARGEST_PART,
    MOST_TOPICS,
    LogMessage,
    LogTopic,
    OneFile,
    checked_name,
    copy_bounded,
    damaged,
    first_byte,
    short_type,
)

MAGIC = b"SQLite format 3\0"
_CACHE_KB = 16_000


class SqliteLog(OneFile):
    """rosbag2 log in SQLite; implements `analysis.logs.log_file.LogFile`."""

    format = "rosbag2, SQLite"

    def __init__(self, path: Path, file: Path, scratch: Path) -> None:
        """Read the list of topics.

        Args:
            path: the file as given, which messages name.
            file: the database: the same, or its unpacked copy.
            scratch: folder for a copy with the write-ahead log, if there is one.

        Raises:
            SettingsError: the file is not a rosbag2 log, is damaged, or has an
                unfinished transaction.
        """
        super().__init__(path, file)
        self._uri = _uri_of(file, scratch)
        self._numbers: dict[int, str] = {}
        with self._opened() as database:
            tables = {
                name
                for (name,) in database.execute(
                    "SELECT name FROM sqlite_master WHERE type = 'table' AND "
                    "sql NOT LIKE 'CREATE VIRTUAL%' LIMIT 1000"
                )
            }
            if not {"topics", "messages"} <= tables:
                raise damaged(
                    path,
                    "not a rosbag2 log: the tables topics and messages are missing",
                    "Give a bag folder, an .mcap, a .db3 or a .bag.",
                )
            self._take_topics(database)

    def messages(self, topics: Collection[str]) -> Iterator[LogMessage]:
        """Yield every message of `topics` in file order."""
        self.losses.clear()
        with self._opened() as database:
            rows = database.execute("SELECT topic_id, timestamp, data FROM messages")
            while True:
                try:
                    row = rows.fetchone()
                    if row is None:
                        return
                    number, received_ns, data = row
                    topic = self._topic(number)
                    if topic not in topics:
                        continue
                    if not (isinstance(received_ns, int) and isinstance(data, bytes)):
                        raise DamageError("a message is not bytes")
                    if data.startswith(ZSTD_MAGIC):
                        data = self.unpacker.unpack(data, "zstd")
                except (sqlite3.Error, DamageError, OverflowError) as error:
                    self.losses[:] = [f"nothing is read after a message: {error}"]
                    return
                yield LogMessage(topic, received_ns, data)

    def _topic(self, number: object) -> str:
        return self._numbers.get(number, "") if isinstance(number, int) else ""

    def _take_topics(self, database: sqlite3.Connection) -> None:
        rows = database.execute(
            "SELECT id, name, type, serialization_format FROM topics "
            f"LIMIT {MOST_TOPICS}"
        )
        for number, *texts in rows:
            name, kind, serialization = _as_texts(texts)
            if serialization != "cdr" or not isinstance(number, int):
                self.unread[name[:100]] = f"{kind[:100]}, {serialization[:40]}"
                continue
            name = checked_name(self.path, name, "the name of a topic")
            kind = short_type(checked_name(self.path, kind, "the name of a type"))
            self._numbers[number] = name
            self.topics[name] = LogTopic(name, kind, "cdr")

    @contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        """Open the database; SQLite errors become SettingsError."""
        try:
            with closing(sqlite3.connect(self._uri, uri=True)) as database:
                database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_PART)
                database.execute("PRAGMA trusted_schema=OFF")
                database.execute("PRAGMA mmap_size=0")
                database.execute(f"PRAGMA cache_size=-{_CACHE_KB}")
                database.text_factory = lambda raw: raw.decode(errors="replace")
                yield database
        except SettingsError:
            raise
        except (sqlite3.Error, UnicodeError, ValueError, OverflowError) as error:
            raise damaged(
                self.path, f"cannot be read as a database ({error})"
            ) from error


def wal_of(path: Path) -> Path:
    """Return the path of the write-ahead log of a database."""
    return path.with_name(f"{path.name}-wal")


def _uri_of(path: Path, scratch: Path) -> str:
    """Return the URI to open: the database, or a copy with its write-ahead log.

    A hot journal is never rolled back, because it may name files that SQLite would
    delete.
    """
    journal, wal = path.with_name(f"{path.name}-journal"), wal_of(path)
    if first_byte(journal) not in (b"", b"\0"):
        raise damaged(
            path,
            f"{journal.name} shows a transaction that has not ended: its messages may "
            "be half written",
            f"Roll it back in a copy of the folder: sqlite3 {path.name} .schema",
        )
    if not first_byte(wal):
        return f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    scratch.mkdir()
    copy = scratch / "log.db3"
    copy_bounded((path, wal), (copy, scratch / "log.db3-wal"))
    return f"file:{quote(str(copy))}?mode=rw"


def _as_texts(row: Any) -> list[str]:  # noqa: ANN401
    return [cell if isinstance(cell, str) else str(cell)[:100] for cell in row]
