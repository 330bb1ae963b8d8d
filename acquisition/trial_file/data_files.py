"""Files of a data folder: regular ones only, of a limited size, inside the folder.

A folder that was copied from elsewhere may hold anything. No symbolic link, pipe,
device or file with a second name outside the session is opened, and no folder below
the session's is reached through a link.
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
# Most bytes of a file, by how its name ends.
SIZE_LIMITS: Mapping[str, int] = {
    ".lock": 4 * 2**10,
    ".json": 2**20,
    ".toml": 2**20,
    ".jsonl": 4 * 2**20,
    ".patch": 16 * 2**20,
    ".mcap": 64 * 2**20,  # a trial of 30 s has 5; the file is read as a whole
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
    """Return how many bytes a file of this name may have."""
    name = path.name.removesuffix(".tmp")
    suffix = ".lock" if name == ".lock" else Path(name).suffix
    return SIZE_LIMITS.get(suffix, _OTHERS)


@contextmanager
def open_folder(path: Path) -> Generator[int]:
    """Give a descriptor of the folder `path`; a subfolder of a session is no link.

    Raises:
        TrialFileError: a subfolder is a symbolic link.
        OSError: it is missing or no folder.
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
    """Say that a trial file in `path` is being written; a kill ends the claim too.

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
    """Return whether a process writes a trial file in `path` now.

    Raises:
        TrialFileError: the folder cannot be opened: nothing is known then.
    """
    try:
        with open_folder(path) as folder:
            return not try_lock(folder)
    except OSError as error:
        check_absent(path, error)
        return False


def open_data(path: Path, flags: int = os.O_RDONLY) -> int:
    """Return a descriptor of the regular file `path`; nothing is waited for.

    Raises:
        TrialFileError: it is not a regular file, has a name outside the session, or is
            larger than its kind may be.
        OSError: it is missing, or cannot be opened.
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
    """Return the whole of a file, as `open_data` opens it.

    Raises:
        TrialFileError: as `open_data`.
        OSError: it is missing, or cannot be read.
    """
    with os.fdopen(open_data(path), "rb") as file:
        return file.read(os.fstat(file.fileno()).st_size)  # even if it grows now


def check_absent(path: Path, error: OSError) -> None:
    """Return if `error` says that there is no file at `path`.

    A file that cannot be read now, for want of a descriptor or of permission, is no
    missing one: what is decided on that would be decided wrongly.

    Raises:
        TrialFileError: it says anything else.
    """
    if error.errno not in _ABSENT:
        reason = f"cannot be read ({error.strerror})"
        raise TrialFileError(path, reason, hint="Nothing was changed.") from error


def list_folder(folder: Path, pattern: str = "*") -> list[Path]:
    """Return what lies in `folder` under names that match `pattern`, sorted.

    A folder that is missing holds nothing; one that cannot be listed is no empty one.

    Raises:
        TrialFileError: it cannot be listed.
    """
    try:
        paths = list(folder.iterdir())
    except OSError as error:
        check_absent(folder, error)
        return []
    return sorted(path for path in paths if fnmatchcase(path.name, pattern))


def check_folders(session: Path) -> None:
    """Refuse a session whose folders lead elsewhere.

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
        TrialFileError: there is something else, or it is reached through a link; or
            nobody can tell.
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
    if status.st_nlink > 1 and _names(path, status) < status.st_nlink:
        raise TrialFileError(path, "has another name elsewhere", hint=_HINT)
    if status.st_size > size_limit(path):
        raise _too_large(path, status.st_size)


def _names(path: Path, wanted: os.stat_result) -> int:
    """Return how many names of a file lie in the session of `path`."""
    is_below = path.parent.name in SUBFOLDERS
    session = path.parent.parent if is_below else path.parent
    names = 0
    for folder in (session, *(session / name for name in SUBFOLDERS)):
        try:
            with open_folder(folder) as descriptor:
                for entry in os.scandir(descriptor):
                    other = entry.stat(follow_symlinks=False)
                    names += os.path.samestat(other, wanted)
        except OSError:
            continue
    return names


def _too_large(path: Path, size: int) -> TrialFileError:
    limit = size_limit(path)
    return TrialFileError(path, f"has {size} bytes, the limit is {limit}")
