"""What the status table needs of one session."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from acquisition.errors import TrialFileError
from experiments.session.store import list_sessions

if TYPE_CHECKING:
    from pathlib import Path

    from analysis.data.terrain_kinds import Value
    from experiments.session.kept_files import Deviation
    from experiments.session.store import SessionFolder
    from experiments.session.where import Where

_FACTORS = "terrain.factors."  # before the name of a condition


@dataclass(frozen=True, slots=True)
class SessionSummary:
    """One session as the table counts it.

    Attributes:
        kept: names of the kept trials whose checksum is right, "T01".
        rejected: how many attempts were rejected or interrupted.
        is_resumable: its journal leaves something to be recorded, or to be put away.
        operator: who opened it last.
        phase: where it stands; "opening" before its first event.
        deviations: what is missing or changed of the kept trials.
        problem: what leads out of the session, cannot be read or contradicts its name;
            None for nothing.
            Such a session is not counted.
    """

    kept: tuple[str, ...] = ()
    rejected: int = 0
    is_resumable: bool = False
    operator: str = ""
    phase: str = ""
    deviations: tuple[Deviation, ...] = ()
    problem: Deviation | None = None

    @property
    def is_sound(self) -> bool:
        """Whether every file is there, can be read and is what the journal says."""
        return self.problem is None and not self.deviations


@dataclass(frozen=True, slots=True)
class SeenSession:
    """A session, and what the table shows of it.

    Attributes:
        folder: the session.
        summary: what the table needs of it.
    """

    folder: SessionFolder
    summary: SessionSummary

    @property
    def facts(self) -> dict[str, Value]:
        """What conditions can ask of it."""
        return {**facts_of(self.folder), "operator": self.summary.operator}


class Checksums:
    """Checksums of files, computed again only where a file has changed on the disk.

    Whoever follows the sessions looks at them every second.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[str, int, int, int, int], str] = {}

    def __call__(self, path: Path) -> str:
        """Return the SHA-256 of a file.

        Raises:
            TrialFileError: it cannot be read.
        """
        from experiments.session.data_files import reading, sha256_of

        with reading(path):
            state = path.stat(follow_symlinks=False)
        key = (
            str(path),
            state.st_ino,
            state.st_size,
            state.st_mtime_ns,
            state.st_ctime_ns,
        )
        if key not in self._known:
            self._known[key] = sha256_of(path)
        return self._known[key]


def glance(folder: SessionFolder) -> SessionSummary:
    """Return a session without checksums: no trial counts as kept or as changed."""
    return summarise(folder, None)


def summarise(
    folder: SessionFolder, digest: Callable[[Path], str] | None
) -> SessionSummary:
    """Return what a session is; kept trials are held against their checksums.

    Args:
        folder: the session.
        digest: computes the checksum of a file; None = no checksum is computed.
    """
    from experiments.session.kept_files import (
        compare_kept,
        contradiction,
        unreadable,
    )
    from experiments.session.lock import owner_of
    from experiments.session.reducer import replay
    from experiments.session.unfinished import is_unfinished

    deviations = tuple(compare_kept(folder, digest)) if digest else ()
    try:
        events = folder.events()
        state = replay(events)
        kept = [a for a in state.kept_trials if digest and folder.find_kept(a, digest)]
        owner_of(folder)
        return SessionSummary(
            kept=tuple(attempt.name.kept for attempt in kept),
            rejected=state.rejected,
            is_resumable=is_unfinished(state),
            operator=state.operator,
            phase=str(state.phase) if events else "opening",
            deviations=deviations,
            problem=contradiction(folder, events),
        )
    except TrialFileError as error:
        return SessionSummary(deviations=deviations, problem=unreadable(folder, error))


def glance_sessions(data: Path) -> list[SeenSession]:
    """Return all sessions below `data` without a look at any checksum."""
    return [SeenSession(folder, glance(folder)) for folder in list_sessions(data)]


def facts_of(folder: SessionFolder) -> dict[str, Value]:
    """Return what conditions can ask of a session that was not read."""
    kind = "simulated" if folder.is_simulated else "live"
    return {"kind": kind, "session": folder.id}


def recorded_factors(folder: SessionFolder) -> list[str]:
    """Return the names of the factors that a session's conditions.json states."""
    from experiments.session.recorded_conditions import read_conditions

    names = read_conditions(folder)
    return [n.removeprefix(_FACTORS) for n in names if n.startswith(_FACTORS)]


def recorded_facts(folder: SessionFolder, where: Where) -> dict[str, Value]:
    """Return what a session's conditions.json states of the keys that are asked for.

    The matrix may have changed since; a session without the file states nothing.
    """
    from experiments.session.recorded_conditions import read_conditions

    if not where.keys - {"terrain", "kind", "session", "operator"}:
        return {}
    stated = read_conditions(folder)
    prefixes = ("terrain.", _FACTORS)
    return {
        key: None if stated[name] == "None" else stated[name]
        for key in where.keys
        for name in (prefix + key for prefix in prefixes)
        if name in stated
    }
