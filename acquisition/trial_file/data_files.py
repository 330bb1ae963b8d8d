"""Safe access to a data folder: regular files of limited size inside the folder.

A copied folder is untrusted. Symbolic links, pipes, devices and files with a hard link
outside the session are not opened, and no subfolder is reached through a link.
"""

import contextlib
import errno
import os
import stat
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path

from acquisition.errors import TrialFileError
from acquisition.files import FOLDER, NO_LINK, UNFOLLOWED, open_directory
from acquisition.locks import try_lock

SUBFOLDERS = ("trials", "rejected", "faults")
# Largest size of a file [bytes], by suffix.
SIZE_LIMITS: Mapping[str, int] = {
    ".lock": 4 * 2**10,
    ".json": 2**20,
    ".toml": 2**20,
    ".jsonl": 4 * 2**20,
    ".patch": 16 * 2**20,
    ".mcap": 64 * 2**20,  # a trial of 30 s has 5 MiB; the file is read as a whole
    ".partial": 64 * 2**20,
}
_OTHERS = 16 * 2**20
_KINDS = (
    (stat.S_ISLNK, "is a symbolic link"),
    (stat.S_ISDIR, "is a folder"),
    (stat.S_ISFIFO, "is a pipe"),
    (stat.S_ISSOCK, "is a socket"),
    (stat.S_ISCHR, "is a device"),
    (stat.S_ISBLK, "is a device"),
)
_ABSENT = {errno.ENOENT, errno.ENOTDIR, errno.ENAMETOOLONG, errno.ELOOP}
_HINT = "Nothing in a data folder may lead out of it. The file was not opened."


def size_limit(path: Path) -> int:
    """Return the size limit of a file by its name [bytes]."""
    name = path.name.removesuffix(".tmp")
    suffix = ".lock" if name == ".lock" else Path(name).suffix
    return SIZE_LIMITS.get(suffix, _OTHERS)


@contextmanager
def open_folder(path: Path) -> Generator[int]:
    """Open the folder `path` and yield its descriptor.

    Raises:
        TrialFileError: a subfolder of a session is a symbolic link.
        OSError: the folder is missing, or not a folder.
    """
    if path.name not in SUBFOLDERS:
        with open_directory(path) as descriptor:
            yield descriptor
        return
    with open_directory(path.parent) as outer:
        _check_kind(path, _stat(path.name, outer), is_folder=True)
        descriptor = os.open(path.name, FOLDER | NO_LINK, dir_fd=outer)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


@contextmanager
def claimed_folder(path: Path) -> Generator[None]:
    """Hold a lock while a trial file in `path` is written; a kill releases it.

    Raises:
        TrialFileError: the folder is missing, or a symbolic link.
    """
    with contextlib.ExitStack() as stack:
        try:
            folder = stack.enter_context(open_folder(path))
        except OSError as error:
            raise TrialFileError(
                path, f"cannot be opened ({error.strerror})"
            ) from error
        try_lock(folder, is_shared=True)
        yield


def is_claimed(path: Path) -> bool:
    """Return whether a process is writing a trial file in `path`.

    Raises:
        TrialFileError: the folder cannot be opened.
    """
    try:
        with open_folder(path) as folder:
            return not try_lock(folder)
    except OSError as error:
        check_absent(path, error)
        return False


def open_data(path: Path, flags: int = os.O_RDONLY) -> int:
    """Open the regular file `path` without blocking; return its descriptor.

    Raises:
        TrialFileError: not a regular file, hard-linked outside the session, or larger
            than the limit of its kind.
        OSError: the file is missing or cannot be opened.
    """
    with open_folder(path.parent) as folder:
        with contextlib.suppress(FileNotFoundError):
            _check_kind(path, _stat(path.name, folder))
        descriptor = os.open(path.name, flags | UNFOLLOWED, 0o644, dir_fd=folder)
    try:
        _check_open(descriptor, path)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def read_data(path: Path) -> bytes:
    """Return the content of a file opened by `open_data`.

    Raises:
        TrialFileError: as for `open_data`.
        OSError: the file is missing or cannot be read.
    """
    with os.fdopen(open_data(path), "rb") as file:
        return file.read(os.fstat(file.fileno()).st_size)  # bounded if it grows


def check_absent(path: Path, error: OSError) -> None:
    """Return if `error` means that there is no file at `path`; raise otherwise.

    A file that cannot be read, for lack of descriptors or permission, must not be
    treated as missing.

    Raises:
        TrialFileError: any other error.
    """
    if error.errno not in _ABSENT:
        reason = f"cannot be read ({error.strerror})"
        raise TrialFileError(path, reason, hint="Nothing was changed.") from error


def list_folder(folder: Path, pattern: str = "*") -> list[Path]:
    """Return the paths in `folder` that match `pattern`, sorted.

    Empty for a missing folder.

    Raises:
        TrialFileError: the folder cannot be listed.
    """
    try:
        paths = list(folder.iterdir())
    except OSError as error:
        check_absent(folder, error)
        return []
    return sorted(path for path in paths if fnmatchcase(path.name, pattern))


def check_folders(session: Path) -> None:
    """Refuse a session whose subfolders are links.

    Raises:
        TrialFileError: trials/, rejected/ or faults/ is not a folder.
    """
    for name in SUBFOLDERS:
        path = session / name
        with contextlib.suppress(FileNotFoundError):
            _check_kind(path, path.lstat(), is_folder=True)


def is_there(path: Path) -> bool:
    """Return whether there is a regular file at `path`.

    Raises:
        TrialFileError: not a regular file, reached through a link, or not accessible.
    """
    try:
        with open_folder(path.parent) as folder:
            status = _stat(path.name, folder)
    except OSError as error:
        check_absent(path, error)
        return False
    _check_kind(path, status)
    return True


def _stat(name: str, folder: int) -> os.stat_result:
    return os.stat(name, dir_fd=folder, follow_symlinks=False)


def _check_kind(path: Path, status: os.stat_result, *, is_folder: bool = False) -> None:
    if is_folder and stat.S_ISDIR(status.st_mode):
        return
    for is_kind, what in _KINDS:
        if is_kind(status.st_mode):
            raise TrialFileError(path, what, hint=_HINT)
    if is_folder:
        raise TrialFileError(path, "is not a folder", hint=_HINT)


def _check_open(descriptor: int, path: Path) -> None:
    status = os.fstat(descriptor)
    _check_kind(path, status)
    if status.st_nlink > 1 and _link_count(path, status) < status.st_nlink:
        raise TrialFileError(path, "has another name elsewhere", hint=_HINT)
    if status.st_size > size_limit(path):
        raise _too_large(path, status.st_size)


def _link_count(path: Path, target: os.stat_result) -> int:
    """Return the number of hard links of a file within the session of `path`."""
    is_below = path.parent.name in SUBFOLDERS
    session = path.parent.parent if is_below else path.parent
    count = 0
    for folder in (session, *(session / name for name in SUBFOLDERS)):
        try:
            with open_folder(folder) as descriptor:
                for entry in os.scandir(descriptor):
                    other = entry.stat(follow_symlinks=False)
                    count += os.path.samestat(other, target)
        except OSError:
            continue
    return count


def _too_large(path: Path, size: int) -> TrialFileError:
    limit = size_limit(path)
    return TrialFileError(path, f"has {size} bytes, the limit is {limit}")
