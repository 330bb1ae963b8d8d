"""Record the disk operations of the program at its system calls.

The program is unchanged and nothing is simulated: every call is executed, and its
effect on files below one folder is recorded. `test_disks` checks that the record is
complete: replaying it gives the files on the disk.
"""

import io
import os
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

_WRITING = os.O_WRONLY | os.O_RDWR
_REAL_OPEN = io.open


@dataclass(frozen=True, slots=True)
class Write:
    """Bytes were written to a file."""

    file: int
    offset: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Truncate:
    """A file was truncated, or extended by zeros."""

    file: int
    size: int


@dataclass(frozen=True, slots=True)
class SyncFile:
    """A file was synced to the disk."""

    file: int


@dataclass(frozen=True, slots=True)
class MakeFolder:
    """A folder was created; paths are relative to the recorded folder."""

    path: Path


@dataclass(frozen=True, slots=True)
class RemoveFolder:
    """A folder was removed."""

    path: Path


@dataclass(frozen=True, slots=True)
class Link:
    """A name was given to a new or an existing file."""

    path: Path
    file: int


@dataclass(frozen=True, slots=True)
class Unlink:
    """A name was removed."""

    path: Path


@dataclass(frozen=True, slots=True)
class Replace:
    """A file was renamed in its folder, replacing any file of that name."""

    source: Path
    target: Path
    file: int


@dataclass(frozen=True, slots=True)
class SyncFolder:
    """The names in a folder were synced to the disk."""

    path: Path


Operation = (
    Write
    | Truncate
    | SyncFile
    | MakeFolder
    | RemoveFolder
    | Link
    | Unlink
    | Replace
    | SyncFolder
)


# Called with the name of a call and its bytes to write (0 = none); returns the bytes
# that it may write, or raises the kernel's error.
Limit = Callable[[str, int], int]


def without_limit(_: str, size: int) -> int:
    """Return `size`: every call succeeds."""
    return size


class Recording:
    """The operations on files and folders below `root`, in order.

    Existing files and folders count as created and synced before.

    Attributes:
        root: the recorded folder.
        operations: operations below that folder.
        start: number of operations that created the existing files.
    """

    def __init__(self, root: Path, limit: Limit) -> None:
        self.root = root.resolve()
        self.limit = limit
        self.operations: list[Operation] = []
        self._names: dict[Path, int] = {}
        self._open: dict[int, int] = {}
        self._appending: set[int] = set()
        self._files = 0
        self._add_existing()
        self.start = len(self.operations)

    def _add_existing(self) -> None:
        first_names: dict[int, Path] = {}
        for path in sorted(self.root.rglob("*")):
            below = path.relative_to(self.root)
            if path.is_dir():
                self.operations.append(MakeFolder(below))
                continue
            first = first_names.setdefault(path.stat().st_ino, below)
            if first != below:
                self.linked(first, below)
                continue
            number = self._create(below)
            self.operations += [Write(number, 0, path.read_bytes()), SyncFile(number)]
        folders = [path for path in self.root.rglob("*") if path.is_dir()]
        self.operations += [
            SyncFolder(path.relative_to(self.root)) for path in [self.root, *folders]
        ]

    def below(self, path: object, folder: int | None = None) -> Path | None:
        """Return `path` relative to the root; None outside the root."""
        if not isinstance(path, str | os.PathLike):
            return None
        location = Path(os.fspath(path))
        if folder is not None:
            location = Path(f"/proc/self/fd/{folder}").readlink() / location
        location = location.parent.resolve() / location.name
        inside = location == self.root or self.root in location.parents
        return location.relative_to(self.root) if inside else None

    def is_inside(self, file: object) -> bool:
        """Return whether a path or a descriptor is below the root."""
        location = (
            Path(f"/proc/self/fd/{file}").readlink() if type(file) is int else file
        )
        return self.below(location) is not None

    def opened(self, path: Path, descriptor: int, flags: int, *, was_there: bool):
        """Record the opening of a file, which may create or truncate it."""
        if not flags & _WRITING:
            return
        if not was_there:
            self._create(path)
        self._open[descriptor] = self._names[path]
        self._appending.discard(descriptor)
        if flags & os.O_APPEND:
            self._appending.add(descriptor)
        if flags & os.O_TRUNC and was_there:
            self.operations.append(Truncate(self._names[path], 0))

    def closed(self, descriptor: int) -> None:
        self._open.pop(descriptor, None)

    def written(self, descriptor: int, offset: int, data: bytes) -> None:
        if descriptor in self._open:
            self.operations.append(Write(self._open[descriptor], offset, data))

    def write_offset(self, descriptor: int) -> int:
        """Return the offset of the next write of a descriptor; 0 outside the folder."""
        if descriptor not in self._open:
            return 0
        if descriptor in self._appending:
            return os.fstat(descriptor).st_size
        return os.lseek(descriptor, 0, os.SEEK_CUR)

    def truncated(self, descriptor: int, size: int) -> None:
        if descriptor in self._open:
            self.operations.append(Truncate(self._open[descriptor], size))

    def synced(self, descriptor: int) -> None:
        if descriptor in self._open:
            self.operations.append(SyncFile(self._open[descriptor]))
            return
        path = self.below(Path(f"/proc/self/fd/{descriptor}").readlink())
        if path is not None and (self.root / path).is_dir():
            self.operations.append(SyncFolder(path))

    def linked(self, source: Path, target: Path) -> None:
        self._names[target] = self._names[source]
        self.operations.append(Link(target, self._names[source]))

    def unlinked(self, path: Path) -> None:
        del self._names[path]
        self.operations.append(Unlink(path))

    def replaced(self, source: Path, target: Path) -> None:
        assert source.parent == target.parent, "a rename across folders is not atomic"
        number = self._names[target] = self._names.pop(source)
        self.operations.append(Replace(source, target, number))

    def _create(self, path: Path) -> int:
        self._files += 1
        self._names[path] = self._files
        self.operations.append(Link(path, self._files))
        return self._files


class _RecordedFile(io.FileIO):
    """A file whose writes are recorded; Python buffers them as usual."""

    recording: Recording

    def write(self, data) -> int:
        offset = self.recording.write_offset(self.fileno())
        allowed = self.recording.limit("write", len(data))
        count = super().write(bytes(data[:allowed]))
        self.recording.written(self.fileno(), offset, bytes(data[:count]))
        return count

    def close(self) -> None:
        if not self.closed:
            self.recording.closed(self.fileno())
        super().close()


class _LimitedFile(io.FileIO):
    """A file whose reading may fail."""

    limit: Limit

    def readinto(self, buffer, /) -> int | None:
        self.limit("read", 0)
        return super().readinto(buffer)

    def read(self, size=-1, /) -> bytes | None:
        self.limit("read", 0)
        return super().read(size)

    def readall(self) -> bytes:
        self.limit("read", 0)
        return super().readall()


_FLAGS = {"r": os.O_RDONLY, "w": os.O_WRONLY | os.O_CREAT | os.O_TRUNC}
_FLAGS |= {"x": os.O_WRONLY | os.O_CREAT | os.O_EXCL}
_FLAGS |= {"a": os.O_WRONLY | os.O_CREAT | os.O_APPEND}


def _flags(mode: str) -> int:
    flags = _FLAGS[next(letter for letter in mode if letter in _FLAGS)]
    return flags & ~os.O_WRONLY | os.O_RDWR if "+" in mode else flags


def _recorded_open(recording: Recording):
    """Return a replacement of `io.open` and `os.fdopen`."""
    kind = type("_File", (_RecordedFile,), {"recording": recording})
    read_only = type("_Read", (_LimitedFile,), {"limit": staticmethod(recording.limit)})

    def reading(file, mode, buffering, encoding, *rest, **named):
        raw = read_only(file, "r")
        if buffering == 0:
            return raw
        binary = io.BufferedReader(raw)
        if "b" in mode:
            return binary
        return io.TextIOWrapper(binary, encoding or "utf-8", *rest, **named)

    def opened(file, mode="r", buffering=-1, encoding=None, *rest, **named):
        flags = _flags(mode)
        is_descriptor = isinstance(file, int)
        inside = is_descriptor or recording.below(file) is not None
        if not flags & _WRITING and recording.is_inside(file):
            if not is_descriptor:
                recording.limit("open", 0)
            return reading(file, mode, buffering, encoding, *rest, **named)
        if not inside or not flags & _WRITING:
            return _REAL_OPEN(file, mode, buffering, encoding, *rest, **named)
        descriptor = file if is_descriptor else os.open(file, flags, 0o666)
        raw = kind(descriptor, mode.replace("b", "").replace("t", ""))
        if buffering == 0:
            return raw
        size = buffering if buffering > 1 else io.DEFAULT_BUFFER_SIZE
        buffered = io.BufferedRandom if "+" in mode else io.BufferedWriter
        binary = buffered(raw, size)
        if "b" in mode:
            return binary
        return io.TextIOWrapper(binary, encoding or "utf-8", *rest, **named)

    return opened


def _recorded_calls(recording: Recording):
    """Return replacements of the writing calls of `os`, by name."""
    real = {name: getattr(os, name) for name in _CALLS}

    def os_open(path, flags, mode=0o777, *, dir_fd=None):
        below = recording.below(path, dir_fd)
        if below is not None:
            recording.limit("create" if flags & os.O_CREAT else "open", 0)
        was_there = below is not None and (recording.root / below).exists()
        descriptor = real["open"](path, flags, mode, dir_fd=dir_fd)
        recording.closed(descriptor)
        if below is not None and not flags & os.O_DIRECTORY:
            recording.opened(below, descriptor, flags, was_there=was_there)
        return descriptor

    def link(src, dst, *, src_dir_fd=None, dst_dir_fd=None, follow_symlinks=True):
        target = recording.below(dst, dst_dir_fd)
        if target is not None:
            recording.limit("create", 0)
        real["link"](
            src,
            dst,
            src_dir_fd=src_dir_fd,
            dst_dir_fd=dst_dir_fd,
            follow_symlinks=follow_symlinks,
        )
        if target is not None:
            recording.linked(recording.below(src, src_dir_fd), target)

    def replace(src, dst, *, src_dir_fd=None, dst_dir_fd=None):
        target = recording.below(dst, dst_dir_fd)
        if target is not None:
            recording.limit("replace", 0)
        real["replace"](src, dst, src_dir_fd=src_dir_fd, dst_dir_fd=dst_dir_fd)
        if target is not None:
            recording.replaced(recording.below(src, src_dir_fd), target)

    def on_name(name, note):
        def called(path, *arguments, dir_fd=None):
            below = recording.below(path, dir_fd)
            if below is not None:
                recording.limit("create" if name == "mkdir" else name, 0)
            real[name](path, *arguments, dir_fd=dir_fd)
            if below is not None:
                note(below)

        return called

    def write(descriptor, data):
        offset = recording.write_offset(descriptor)
        count = real["write"](descriptor, data)
        recording.written(descriptor, offset, bytes(data[:count]))
        return count

    def pwrite(descriptor, data, offset):
        count = real["pwrite"](descriptor, data, offset)
        recording.written(descriptor, offset, bytes(data[:count]))
        return count

    def ftruncate(descriptor, size):
        real["ftruncate"](descriptor, size)
        recording.truncated(descriptor, size)

    def fsync(descriptor):
        recording.limit("fsync", 0)
        recording.synced(descriptor)  # only the order matters: do not sync

    def close(descriptor):
        recording.closed(descriptor)
        real["close"](descriptor)

    record = recording.operations.append
    return {
        "open": os_open,
        "link": link,
        "replace": replace,
        "rename": replace,
        "unlink": on_name("unlink", recording.unlinked),
        "remove": on_name("remove", recording.unlinked),
        "mkdir": on_name("mkdir", lambda path: record(MakeFolder(path))),
        "rmdir": on_name("rmdir", lambda path: record(RemoveFolder(path))),
        "write": write,
        "pwrite": pwrite,
        "ftruncate": ftruncate,
        "fsync": fsync,
        "close": close,
    }


def _reading_calls(recording: Recording):
    """Return replacements of the reading calls of `os`, by name."""

    def on_read(name, what):
        real = getattr(os, name)

        def called(path=".", *arguments):
            if recording.is_inside(path):
                recording.limit(what, 0)
            return real(path, *arguments)

        return called

    calls = {"read": "read", "pread": "read", "listdir": "list", "scandir": "list"}
    return {name: on_read(name, what) for name, what in calls.items()}


_CALLS = [
    "open",
    "link",
    "replace",
    "rename",
    "unlink",
    "remove",
    "mkdir",
    "rmdir",
    "write",
    "pwrite",
    "ftruncate",
    "fsync",
    "close",
]


@contextmanager
def recorded(root: Path, limit: Limit = without_limit) -> Generator[Recording]:
    """Record this process's operations on files below `root` in the context.

    Args:
        root: the recorded folder.
        limit: makes calls fail as on a full or broken disk; they are not recorded.
    """
    recording = Recording(root, limit)
    with pytest.MonkeyPatch.context() as patch:
        calls = _recorded_calls(recording) | _reading_calls(recording)
        for name, call in calls.items():
            patch.setattr(os, name, call)
        patch.setattr(io, "open", _recorded_open(recording))
        yield recording
