"""Giving a finished file its final name, once and for all."""

import os
from pathlib import Path


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


def sync_directory(folder: Path) -> None:
    """Force the names in `folder` to the disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def make_directories(folder: Path) -> None:
    """Make `folder` and what is missing above it; every name reaches the disk.

    Raises:
        OSError: one cannot be made.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for path in reversed(missing):
        sync_directory(path.parent)
