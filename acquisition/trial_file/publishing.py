"""Giving a finished file its final name, once and for all."""

import os
from pathlib import Path


def publish_file(written: Path, path: Path) -> None:
    """Give the file `written` the name `path`, read-only; never replaces a file.

    Raises:
        OSError: `path` exists, or the disk is full or gone.
    """
    written.chmod(0o444)
    path.hardlink_to(written)
    written.unlink()
    sync_directory(path.parent)


def sync_directory(folder: Path) -> None:
    """Force the names in `folder` to the disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
