"""Removal of sessions killed before their first event, to free their numbers."""

import shutil
from pathlib import Path

from acquisition.clock import NS_PER_S
from acquisition.errors import TractionError
from experiments.session.lock import LOCK_FILE, owner_of
from experiments.session.store import SessionFolder, list_sessions

# Files written before the first line of the journal.
_BEFORE = frozenset(
    {"config.toml", "matrix.toml", "diff.patch", "preflight.json", "provenance.json"}
    | {LOCK_FILE}
)
_YOUNG_NS = 60 * NS_PER_S  # another process may be about to lock it


def remove_never_started(data: Path, utc_ns: int) -> list[str]:
    """Remove folders in which no session ever started; returns their names.

    Such a folder contains only files written before the first event, no process has it
    open, and it is a minute old.

    Args:
        data: the data folder.
        utc_ns: time of day [ns].
    """
    cleared: list[str] = []
    for folder in list_sessions(data):
        try:
            if _is_unbegun(folder, utc_ns):
                shutil.rmtree(folder.path)
                cleared.append(folder.path.name)
        except (OSError, TractionError):
            continue  # the folder stays
    return cleared


def _is_unbegun(folder: SessionFolder, utc_ns: int) -> bool:
    paths = [folder.path, *folder.path.rglob("*")]
    if any(path.is_symlink() for path in paths):
        return False
    files = [path for path in paths if not path.is_dir()]
    expected = {folder.path / name for name in _BEFORE}
    newest_ns = max(path.stat().st_mtime_ns for path in paths)
    is_old = utc_ns - newest_ns > _YOUNG_NS
    return is_old and expected.issuperset(files) and owner_of(folder) is None
