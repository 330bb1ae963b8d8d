"""Safe reading of untrusted files and atomic, durable writing.

`open_regular` and `read_regular` open regular files only, never block, and read up to a
given size. Content is synchronised to the disk before it gets its final name, so that
neither a kill nor a power cut leaves a partial file.
"""

import os
import secrets
import stat
from collections.abc import Generator
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path


def _flags(*names: str) -> int:
    """Return flags of `os.open`; those missing on this platform are 0."""
    return sum(getattr(os, f"O_{name}", 0) for name in names)


NO_LINK = _flags("NOFOLLOW")  # for the last component of a path
# do not follow a link, block on a pipe, or acquire a terminal
UNFOLLOWED = NO_LINK | _flags("NONBLOCK", "CLOEXEC", "NOCTTY", "BINARY")
FOLDER = _flags("RDONLY", "DIRECTORY", "CLOEXEC")
_NEW = _flags("WRONLY", "CREAT", "EXCL", "CLOEXEC", "BINARY")
_PIECE = 1 << 20  # bytes per read


class UnfitFileError(ValueError):
    """A path is not a regular file, or the file is too large, as the message states."""


class NotRegularError(UnfitFileError):
    """A path is a folder, pipe, device or socket."""


def open_regular(path: Path, *, is_link_followed: bool = False) -> BufferedReader:
    """Open the regular file `path` for reading, without blocking.

    Args:
        path: path of the file.
        is_link_followed: follow symbolic links, as for a path given by a person;
            otherwise a link is an error.

    Raises:
        NotRegularError: not a regular file; no device or pipe is opened.
        OSError: the file is missing, a link, or cannot be opened.
    """
    status = path.stat() if is_link_followed else path.lstat()
    if not stat.S_ISLNK(status.st_mode):  # a link is refused by `open`
        _check_regular(status)
    flags = UNFOLLOWED & ~NO_LINK if is_link_followed else UNFOLLOWED
    file = os.fdopen(os.open(path, os.O_RDONLY | flags), "rb")
    try:
        _check_regular(os.fstat(file.fileno()))  # may have been replaced since stat
    except BaseException:
        file.close()
        raise
    return file


def read_regular(path: Path, most: int, *, is_link_followed: bool = False) -> bytes:
    """Return the content of a regular file.

    Args:
        path: path of the file.
        most: largest accepted size [bytes].
        is_link_followed: as for `open_regular`.

    Raises:
        UnfitFileError: not a regular file, or too large.
        OSError: the file is missing, a link, or cannot be read.
    """
    parts: list[bytes] = []
    remaining = most + 1
    with open_regular(path, is_link_followed=is_link_followed) as file:
        # In pieces: read(n) allocates n bytes, however small the file is.
        while remaining > 0 and (part := file.read(min(remaining, _PIECE))):
            parts.append(part)
            remaining -= len(part)
    if remaining <= 0:
        raise UnfitFileError(f"is larger than {most / 1e6:.0f} MB")
    return b"".join(parts)


@contextmanager
def open_directory(path: Path) -> Generator[int]:
    """Open the folder `path` and yield its descriptor.

    Raises:
        OSError: the folder is missing, or not a folder.
    """
    descriptor = os.open(path, FOLDER)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def create_file(folder: int, name: str, content: bytes, mode: int = 0o644) -> None:
    """Write and synchronise a new file; never replaces an existing one.

    The name is durable after the folder is synchronised, too.

    Args:
        folder: descriptor of the folder.
        name: name in the folder.
        content: content of the file.
        mode: permissions before the umask.

    Raises:
        OSError: the file exists, or the disk is full or unavailable; no partial file
            remains.
    """
    descriptor = os.open(name, _NEW, mode, dir_fd=folder)
    with removed_at_error(folder, name), os.fdopen(descriptor, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def replace_file(folder: int, name: str, content: bytes, mode: int = 0o644) -> None:
    """Replace a file atomically: a reader sees the old content or the new.

    Arguments as for `create_file`. A kill may leave a file .XXX.NAME.tmp.

    Raises:
        OSError: the disk is full or unavailable; the old file remains.
    """
    temporary = f".{secrets.token_hex(4)}.{name}.tmp"
    create_file(folder, temporary, content, mode)
    with removed_at_error(folder, temporary):
        os.replace(temporary, name, src_dir_fd=folder, dst_dir_fd=folder)


@contextmanager
def removed_at_error(folder: int, name: str) -> Generator[None]:
    """Remove the new file `name` if the body fails."""
    try:
        yield
    except BaseException:
        with suppress(OSError):
            os.unlink(name, dir_fd=folder)
        raise


def publish_file(written: Path, path: Path) -> None:
    """Rename `written` to `path`, read-only; never replaces an existing file.

    The new name is synchronised before the old one is removed: a file system may
    reorder the two, and a power cut in between would lose the file.

    Raises:
        OSError: `path` exists, or the disk is full or unavailable.
    """
    written.chmod(0o444)
    path.hardlink_to(written)
    sync_directory(path.parent)
    written.unlink()
    sync_directory(written.parent)


def sync_directory(path: Path) -> None:
    """Synchronise a folder's entries to the disk.

    Raises:
        OSError: the disk is gone.
    """
    with open_directory(path) as folder:
        os.fsync(folder)


def make_directories(path: Path) -> None:
    """Create a folder and its missing parents, synchronised to the disk.

    Raises:
        OSError: a folder cannot be created.
    """
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    for folder in reversed(missing):
        sync_directory(folder.parent)


def _check_regular(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise NotRegularError("is not a regular file")
