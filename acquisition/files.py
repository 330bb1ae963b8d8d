"""Files that are read without surprises and written whole or not at all.

A file that was copied from elsewhere, or lies where others may write, can be anything:
`open_regular` and `read_regular` open nothing but a regular file, wait for nothing and
take no more than a stated size. What is written reaches the disk before it gets its
name, so that neither a kill nor a power cut leaves a part of it.
"""

import os
import secrets
import stat
from collections.abc import Generator
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path


def _flags(*names: str) -> int:
    """Return flags of `os.open`; systems lack those of what they do not have."""
    return sum(getattr(os, f"O_{name}", 0) for name in names)


NO_LINK = _flags("NOFOLLOW")  # at the last name of a path
# follows no link, waits for no pipe, takes no terminal
UNFOLLOWED = NO_LINK | _flags("NONBLOCK", "CLOEXEC", "NOCTTY", "BINARY")
FOLDER = _flags("RDONLY", "DIRECTORY", "CLOEXEC")
_NEW = _flags("WRONLY", "CREAT", "EXCL", "CLOEXEC", "BINARY")
_PIECE = 1 << 20  # bytes that are read at once


class UnfitFileError(ValueError):
    """What lies at a path is not a regular file, or too large; the text says which."""


class NotRegularError(UnfitFileError):
    """It is a folder, a pipe, a device or a socket."""


def open_regular(path: Path, *, is_link_followed: bool = False) -> BufferedReader:
    """Return the regular file `path`, open for reading; nothing is waited for.

    Args:
        path: of the file.
        is_link_followed: a symbolic link stands for its file, as where a person names
            the file; else it cannot be opened.

    Raises:
        NotRegularError: it is not a regular file; no device or pipe is opened.
        OSError: it is missing, a link, or cannot be opened.
    """
    status = path.stat() if is_link_followed else path.lstat()
    if not stat.S_ISLNK(status.st_mode):  # a link is refused by `open`
        _check_regular(status)
    flags = UNFOLLOWED & ~NO_LINK if is_link_followed else UNFOLLOWED
    file = os.fdopen(os.open(path, os.O_RDONLY | flags), "rb")
    try:
        _check_regular(os.fstat(file.fileno()))  # it may have been exchanged meanwhile
    except BaseException:
        file.close()
        raise
    return file


def read_regular(path: Path, most: int, *, is_link_followed: bool = False) -> bytes:
    """Return the whole of a file, as `open_regular` opens it.

    Args:
        path: of the file.
        most: bytes that it may have.
        is_link_followed: as for `open_regular`.

    Raises:
        UnfitFileError: it is not a regular file, or larger.
        OSError: it is missing, a link, or cannot be read.
    """
    parts: list[bytes] = []
    left = most + 1
    with open_regular(path, is_link_followed=is_link_followed) as file:
        # Piece by piece: a read takes the memory that it is asked for, not the file's.
        while left > 0 and (part := file.read(min(left, _PIECE))):
            parts.append(part)
            left -= len(part)
    if left <= 0:
        raise UnfitFileError(f"is larger than {most / 1e6:.0f} MB")
    return b"".join(parts)


@contextmanager
def open_directory(path: Path) -> Generator[int]:
    """Give a descriptor of the folder `path`.

    Raises:
        OSError: it is missing or no folder.
    """
    descriptor = os.open(path, FOLDER)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def create_file(folder: int, name: str, content: bytes, mode: int = 0o644) -> None:
    """Write `content`, down to the disk, into a new file; never replaces one.

    The name itself is for good once the folder is synchronised.

    Args:
        folder: descriptor of the folder.
        name: in the folder.
        content: of the file.
        mode: permissions, less the process's umask.

    Raises:
        OSError: it exists, or the disk is full or gone; no part of it stays.
    """
    descriptor = os.open(name, _NEW, mode, dir_fd=folder)
    with removed_at_error(folder, name), os.fdopen(descriptor, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def replace_file(folder: int, name: str, content: bytes, mode: int = 0o644) -> None:
    """Write `content` to a file: a reader sees the old one or the new, never a part.

    Arguments are those of `create_file`. What a kill leaves is called .XXX.NAME.tmp.

    Raises:
        OSError: the disk is full or gone; the old file stays.
    """
    temporary = f".{secrets.token_hex(4)}.{name}.tmp"
    create_file(folder, temporary, content, mode)
    with removed_at_error(folder, temporary):
        os.replace(temporary, name, src_dir_fd=folder, dst_dir_fd=folder)


@contextmanager
def removed_at_error(folder: int, name: str) -> Generator[None]:
    """Take the new file `name` away if what follows fails."""
    try:
        yield
    except BaseException:
        with suppress(OSError):
            os.unlink(name, dir_fd=folder)
        raise


def publish_file(written: Path, path: Path) -> None:
    """Give the file `written` the name `path`, read-only; never replaces a file.

    The new name reaches the disk before the old one goes: a file system may reorder
    the two, and a power cut between them would leave a file without a name.

    Raises:
        OSError: `path` exists, or the disk is full or gone.
    """
    written.chmod(0o444)
    path.hardlink_to(written)
    sync_directory(path.parent)
    written.unlink()
    sync_directory(written.parent)


def sync_directory(path: Path) -> None:
    """Force the names in a folder to the disk.

    Raises:
        OSError: the disk is gone.
    """
    with open_directory(path) as folder:
        os.fsync(folder)


def make_directories(path: Path) -> None:
    """Make a folder and what is missing above it; every name reaches the disk.

    Raises:
        OSError: one cannot be made.
    """
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    for folder in reversed(missing):
        sync_directory(folder.parent)


def _check_regular(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise NotRegularError("is not a regular file")
