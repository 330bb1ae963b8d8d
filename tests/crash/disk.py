"""Possible states of a disk after a sequence of operations and a power cut."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.crash.syscalls import (
    Link,
    MakeFolder,
    Operation,
    RemoveFolder,
    Replace,
    SyncFile,
    SyncFolder,
    Truncate,
    Unlink,
    Write,
)

FOLDER = 0  # used in place of a file number
OUTCOMES = ("none", "all", "first", "torn", "some", "zeros")


@dataclass
class Disk:
    """Names and contents on a disk after a power cut.

    Attributes:
        names: file number by path, `FOLDER` for a folder.
        contents: bytes by file number.
    """

    names: dict[Path, int] = field(default_factory=dict)
    contents: dict[int, bytes] = field(default_factory=dict)

    def files(self) -> dict[Path, bytes]:
        """Return the content of every file reachable from the root, by path."""
        return {
            path: self.contents.get(number, b"")
            for path, number in self.names.items()
            if number != FOLDER and self._is_reachable(path)
        }

    def folders(self) -> list[Path]:
        """Return the folders reachable from the root, parents first."""
        names = [path for path, number in self.names.items() if number == FOLDER]
        return sorted(path for path in names if self._is_reachable(path))

    def write(self, folder: Path) -> None:
        """Write the files into the new folder `folder`."""
        folder.mkdir()
        for path in self.folders():
            (folder / path).mkdir()
        first: dict[int, Path] = {}
        for path, content in self.files().items():
            number = self.names[path]
            if number in first:
                (folder / path).hardlink_to(first[number])
                continue
            first[number] = folder / path
            first[number].write_bytes(content)

    def _is_reachable(self, path: Path) -> bool:
        outer = list(path.parents)[:-1]
        return all(self.names.get(folder) == FOLDER for folder in outer)


def after_all(operations: Sequence[Operation]) -> Disk:
    """Return the disk after all operations without a power cut."""
    return _disk(list(operations))


def after_power_cut(operations: Sequence[Operation], rng: np.random.Generator) -> Disk:
    """Return one possible disk after a power cut right after `operations`.

    Synced operations are on the disk. Of the others, each file and each folder keeps
    none, all, the first few, the first few with the last one torn, a random subset, or
    zeros.
    """
    synced = _synced(operations)
    survived = []
    for members in _by_object(operations).values():
        synced_part = [i for i in members if i in synced]
        unsynced_part = [i for i in members if i not in synced]
        survived += [(i, operations[i]) for i in synced_part]
        survived += _random_part(unsynced_part, operations, rng)
    return _disk([operation for _, operation in sorted(survived, key=lambda p: p[0])])


def _object_of(operation: Operation) -> int | Path:
    """Return the file or folder whose content an operation changes."""
    match operation:
        case Write() | Truncate() | SyncFile():
            return operation.file
        case Replace():
            return operation.target.parent
        case SyncFolder():
            return operation.path
        case _:
            return operation.path.parent


def _by_object(operations: Sequence[Operation]) -> dict[int | Path, list[int]]:
    members: dict[int | Path, list[int]] = {}
    for i, operation in enumerate(operations):
        if not isinstance(operation, SyncFile | SyncFolder):
            members.setdefault(_object_of(operation), []).append(i)
    return members


def _synced(operations: Sequence[Operation]) -> set[int]:
    """Return the indices of all operations that a later fsync made durable."""
    synced: set[int] = set()
    waiting: dict[int | Path, list[int]] = {}
    for i, operation in enumerate(operations):
        if isinstance(operation, SyncFile | SyncFolder):
            synced.update(waiting.pop(_object_of(operation), []))
        else:
            waiting.setdefault(_object_of(operation), []).append(i)
    return synced


def _random_part(
    unsynced: list[int], operations: Sequence[Operation], rng: np.random.Generator
) -> list[tuple[int, Operation]]:
    """Return the part of the unsynced operations that reached the disk."""
    outcome = OUTCOMES[rng.integers(len(OUTCOMES))]
    if outcome == "none" or not unsynced:
        return []
    if outcome in {"first", "torn"}:
        unsynced = unsynced[: int(rng.integers(len(unsynced) + 1))]
    elif outcome == "some":
        unsynced = [i for i in unsynced if rng.random() < 0.5]
    part = [(i, operations[i]) for i in unsynced]
    if outcome == "torn" and part:
        part[-1] = (part[-1][0], _torn(part[-1][1], rng))
    if outcome == "zeros":
        part = [(i, _zeroed(operation)) for i, operation in part]
    return part


def _torn(operation: Operation, rng: np.random.Generator) -> Operation:
    if not isinstance(operation, Write):
        return operation
    size = int(rng.integers(len(operation.data) + 1))
    return Write(operation.file, operation.offset, operation.data[:size])


def _zeroed(operation: Operation) -> Operation:
    if not isinstance(operation, Write):
        return operation
    return Write(operation.file, operation.offset, bytes(len(operation.data)))


def _disk(operations: list[Operation]) -> Disk:
    disk = Disk()
    contents: dict[int, bytearray] = {}
    for operation in operations:
        match operation:
            case Write(file, offset, data):
                content = contents.setdefault(file, bytearray())
                content.extend(bytes(max(0, offset - len(content))))
                content[offset : offset + len(data)] = data
            case Truncate(file, size):
                content = contents.setdefault(file, bytearray())
                content[size:] = bytes(max(0, size - len(content)))
            case MakeFolder(path):
                disk.names[path] = FOLDER
            case RemoveFolder(path) | Unlink(path):
                disk.names.pop(path, None)
            case Link(path, file):
                disk.names[path] = file
            case Replace(source, target, file):
                disk.names.pop(source, None)
                disk.names[target] = file
            case _:
                pass
    disk.contents = {number: bytes(content) for number, content in contents.items()}
    return disk
