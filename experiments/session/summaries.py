"""Summaries of sessions for the status table."""

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
    """Summary of one session for the status table.

    Attributes:
        kept: names of the kept trials whose checksum is right, "T01".
        rejected: number of rejected or interrupted attempts.
        is_resumable: whether trials or a verdict are outstanding.
        operator: operator of the last opening.
        phase: phase of the session; "opening" before its first event.
        deviations: missing or changed files of kept trials.
        problem: why the session is not counted: a link out of it, an unreadable file,
            or a contradiction to its name; None = no problem.
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
        """Whether every file exists, is readable and agrees with the journal."""
        return self.problem is None and not self.deviations


@dataclass(frozen=True, slots=True)
class SessionEntry:
    """A session and its summary.

    Attributes:
        folder: the session.
        summary: its summary.
    """

    folder: SessionFolder
    summary: SessionSummary

    @property
    def facts(self) -> dict[str, Value]:
        """Facts of the session that conditions can test."""
        return {**facts_of(self.folder), "operator": self.summary.operator}


class Checksums:
    """Cache of checksums, computed again only for files changed on the disk.

    `status --follow` asks for all of them every second.
    """

    def __init__(self) -> None:
        self._digests: dict[tuple[str, int, int, int, int], str] = {}

    def __call__(self, path: Path) -> str:
        """Return the SHA-256 of a file.

        Raises:
            TrialFileError: `path` cannot be read.
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
        if key not in self._digests:
            self._digests[key] = sha256_of(path)
        return self._digests[key]


def summarise_unverified(folder: SessionFolder) -> SessionSummary:
    """Summarise a session without checksums: no trial counts as kept or changed."""
    return summarise(folder, None)


def summarise(
    folder: SessionFolder, digest: Callable[[Path], str] | None
) -> SessionSummary:
    """Summarise a session, with kept trials verified by their checksums.

    Args:
        folder: the session.
        digest: function that computes a checksum; None = none is computed.
    """
    from experiments.session.kept_files import (
        compare_kept,
        name_contradiction,
        unreadable,
    )
    from experiments.session.lock import owner_of
    from experiments.session.unfinished import is_unfinished

    deviations: tuple[Deviation, ...] = ()
    try:
        journal = folder.journal()
        state = journal.state
        if digest:
            deviations = tuple(compare_kept(folder, digest, journal))
        kept = [a for a in state.kept_trials if digest and folder.find_kept(a, digest)]
        owner_of(folder)
        return SessionSummary(
            kept=tuple(attempt.name.kept for attempt in kept),
            rejected=state.rejected,
            is_resumable=is_unfinished(state),
            operator=state.operator,
            phase=str(state.phase) if journal.events else "opening",
            deviations=deviations,
            problem=name_contradiction(folder, journal.events),
        )
    except TrialFileError as error:
        return SessionSummary(deviations=deviations, problem=unreadable(folder, error))


def summarise_all_unverified(data: Path) -> list[SessionEntry]:
    """Summarise all sessions below `data` without checksums."""
    return [
        SessionEntry(folder, summarise_unverified(folder))
        for folder in list_sessions(data)
    ]


def facts_of(folder: SessionFolder) -> dict[str, Value]:
    """Facts of a session that are known from its folder's name."""
    kind = "simulated" if folder.is_simulated else "live"
    return {"kind": kind, "session": folder.id}


def recorded_factors(folder: SessionFolder) -> list[str]:
    """Names of the factors in a session's conditions.json."""
    from experiments.session.recorded_conditions import read_conditions

    names = read_conditions(folder)
    return [n.removeprefix(_FACTORS) for n in names if n.startswith(_FACTORS)]


def recorded_facts(folder: SessionFolder, where: Where) -> dict[str, Value]:
    """Facts in a session's conditions.json under the keys of `where`.

    The matrix may have changed since; without the file there are no facts.
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
