"""The status table: kept trials per terrain, counted from verified files only."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

from acquisition.errors import TrialFileError
from acquisition.trial_file.data_files import list_folder
from experiments.session.store import list_sessions
from experiments.session.summaries import (
    Checksums,
    SessionEntry,
    facts_of,
    recorded_facts,
    summarise,
)
from experiments.session.where import Where

if TYPE_CHECKING:
    from pathlib import Path

    from analysis.data.terrain_kinds import Value
    from experiments.session.kept_files import Deviation
    from experiments.session.store import SessionFolder
    from experiments.settings.matrix import MatrixSettings, TerrainRow

EVERYTHING = Where()


def summarise_sessions(
    data: Path, where: Where, digest: Checksums
) -> list[SessionEntry]:
    """Return all sessions below `data`, oldest number first.

    Args:
        data: the data folder.
        where: checksums are computed only for sessions with these values.
        digest: the checksums computed so far.
    """
    folders = [(f, where.matches(facts_of(f))) for f in list_sessions(data)]
    _compute_checksums([folder for folder, is_asked in folders if is_asked], digest)
    return _counted_once(
        [
            SessionEntry(folder, summarise(folder, digest if is_asked else None))
            for folder, is_asked in folders
        ]
    )


def _compute_checksums(folders: Sequence[SessionFolder], digest: Checksums) -> None:
    """Let `digest` remember the checksums of all kept trials, on all cores.

    Whatever cannot be read is reported when it is needed.
    """
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for folder in folders:
            with suppress(TrialFileError):
                for path in list_folder(folder.trials, "T??.mcap"):
                    pool.submit(digest, path)


def _counted_once(seen: list[SessionEntry]) -> list[SessionEntry]:
    """Return the sessions, with trials shared by a copy and its original counted once.

    A session with the number of an earlier one does not count.
    """
    from experiments.session.kept_files import (
        repeated_numbers,
        repeated_trials,
        stated_id,
    )

    duplicates = repeated_numbers([session.folder for session in seen])
    folders = {s.folder.id: s.folder for s in seen if s.summary.problem is None}
    result: list[SessionEntry] = []
    for folder, summary in ((s.folder, s.summary) for s in seen):
        # a copy is not sound: it states another id
        is_asked = summary.problem is None and not summary.is_sound
        original = folders.get(stated_id(folder)) if is_asked else None
        again = set[str]() if original is None else repeated_trials(folder, original)
        kept = tuple(name for name in summary.kept if name not in again)
        problem = summary.problem or duplicates.get(folder.path)
        counted = replace(summary, kept=kept, problem=problem)
        result.append(SessionEntry(folder, counted))
    return result


@dataclass(frozen=True, slots=True)
class MatrixRow:
    """One terrain, live or simulated: kept against planned trials.

    Attributes:
        terrain: name of the terrain.
        is_simulated: whether the devices were simulated.
        kept: number of verified kept trials.
        wanted: number of planned trials.
        rejected: number of rejected or interrupted attempts.
        sessions: ids of the sessions.
        trials: number of sessions in which T01, T02 ... are kept, in this order.
    """

    terrain: str
    is_simulated: bool
    kept: int
    wanted: int
    rejected: int
    sessions: tuple[str, ...]
    trials: tuple[int, ...]

    def as_dict(self) -> dict[str, object]:
        """Return the row for JSON."""
        return asdict(self)

    def cells(self) -> str:
        """Return one character per trial: kept, kept in several sessions, missing."""
        signs = {0: "·", 1: "█"}
        return "".join(signs.get(n, str(min(n, 9))) for n in self.trials)


def count_rows(
    seen: Sequence[SessionEntry],
    matrix: MatrixSettings,
    where: Where = EVERYTHING,
) -> list[MatrixRow]:
    """Return a row per terrain of the matrix: live, then simulated if recorded.

    Args:
        seen: the sessions.
        matrix: the terrains and their number of trials.
        where: conditions on terrains and sessions.
    """
    sessions = matching_sessions(seen, where)
    rows: list[MatrixRow] = []
    blocks = 1 + matrix.design.repeat_blocks
    for row in matrix.terrains:
        if not where.matches(facts_of_row(row)):
            continue
        for is_simulated in (False, True):
            own = [s for s in sessions if is_of(s, row, is_simulated=is_simulated)]
            is_wanted = not is_simulated and where.matches({"kind": "live"})
            if own or (is_wanted and not {"session", "operator"} & where.keys):
                wanted = row.trials * blocks
                rows.append(_matrix_row(row, own, wanted, is_simulated=is_simulated))
    return rows


def matching_sessions(seen: Sequence[SessionEntry], where: Where) -> list[SessionEntry]:
    """Return the readable sessions that match `where`."""
    return [
        s
        for s in seen
        if s.summary.problem is None
        if where.matches(s.facts) and where.matches(recorded_facts(s.folder, where))
    ]


def is_of(session: SessionEntry, row: TerrainRow, *, is_simulated: bool) -> bool:
    """Return whether a session is of this terrain and kind."""
    folder = session.folder
    return folder.terrain == row.name and folder.is_simulated is is_simulated


def find_deviations(seen: Sequence[SessionEntry], where: Where) -> list[Deviation]:
    """Return the missing or changed kept trials of the table.

    Args:
        seen: the sessions.
        where: conditions on sessions, as in `count_rows`; unreadable sessions are
            always reported.
    """
    asked = [s for s in seen if s.summary.problem or where.matches(s.facts)]
    deviations = [d for s in asked for d in s.summary.deviations]
    deviations += [s.summary.problem for s in seen if s.summary.problem is not None]
    return list(dict.fromkeys(deviations))


def facts_of_row(row: TerrainRow) -> dict[str, Value]:
    """Facts of a row of the matrix that conditions can test."""
    fixed = {"terrain": row.name, "stones": row.stones, "incline_deg": row.incline_deg}
    setup = {"foot": row.foot, "push_deg": float(row.push_deg), "place": row.place}
    return {**row.factors, **fixed, **setup}


def _matrix_row(
    row: TerrainRow,
    sessions: Sequence[SessionEntry],
    wanted: int,
    *,
    is_simulated: bool,
) -> MatrixRow:
    kept = [name for s in sessions for name in s.summary.kept]
    names = [f"T{number:02d}" for number in range(1, row.trials + 1)]
    return MatrixRow(
        terrain=row.name,
        is_simulated=is_simulated,
        kept=len(kept),
        wanted=wanted,
        rejected=sum(s.summary.rejected for s in sessions),
        sessions=tuple(s.folder.id for s in sessions),
        trials=tuple(kept.count(name) for name in names),
    )
