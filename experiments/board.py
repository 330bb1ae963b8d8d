"""The matrix board: kept trials per terrain, counted from verified files only."""

from dataclasses import asdict, dataclass
from pathlib import Path

from experiments.settings import MatrixSettings
from experiments.store import SessionFolder, list_sessions


@dataclass(frozen=True, slots=True)
class BoardLine:
    """One terrain, live or simulated: what is kept of what is wanted."""

    terrain: str
    is_simulated: bool
    kept: int
    wanted: int
    rejected: int
    sessions: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """Return the line for JSON."""
        return asdict(self)


def count_board(data: Path, matrix: MatrixSettings) -> list[BoardLine]:
    """Return a line per terrain of the matrix, live first, simulated where there is."""
    sessions = list_sessions(data)
    lines: list[BoardLine] = []
    for row in matrix.terrains:
        for is_simulated in (False, True):
            own = [
                s
                for s in sessions
                if s.terrain == row.name and s.is_simulated is is_simulated
            ]
            if own or not is_simulated:
                lines.append(
                    _line(row.name, row.trials, own, is_simulated=is_simulated)
                )
    return lines


def _line(
    terrain: str, wanted: int, sessions: list[SessionFolder], *, is_simulated: bool
) -> BoardLine:
    return BoardLine(
        terrain=terrain,
        is_simulated=is_simulated,
        kept=sum(len(session.kept_trials()) for session in sessions),
        wanted=wanted,
        rejected=sum(len(session.rejected_sidecars()) for session in sessions),
        sessions=tuple(session.id for session in sessions),
    )
