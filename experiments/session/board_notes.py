"""What a matrix board does not show: folders that are missing, renamed or filtered."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from experiments.session.matrix_board import MatrixRow
from experiments.session.store import JOURNAL_FILE, list_sessions
from experiments.settings import MatrixSettings


def board_notes(
    data: Path,
    matrix: MatrixSettings,
    where: Mapping[str, str],
    board: Sequence[MatrixRow],
) -> list[str]:
    """Return why a board shows less than somebody may expect, a line for each reason.

    Args:
        data: the data folder.
        matrix: the terrains.
        where: the conditions that the board was counted with.
        board: its rows.
    """
    sessions = data / "sessions"
    if not data.is_dir():
        return [f"There is no data folder {data}: nothing is counted."]
    if not sessions.is_dir():
        return [f"There are no sessions in {data} yet."]
    notes: list[str] = []
    known = list_sessions(data)
    named = {session.path for session in known}
    for path in sorted(sessions.iterdir()):
        if path not in named and (path / JOURNAL_FILE).is_file():
            notes.append(
                f"{path} has a journal, but not the name of a session: it is not "
                "counted. Give it back its name."
            )
    terrains = {row.name for row in matrix.terrains}
    notes += [
        f"{session.path.name}: {session.terrain} is no terrain of the matrix; it is "
        "not counted."
        for session in known
        if session.terrain not in terrains
    ]
    if where and not board:
        asked = ",".join(f"{key}={value}" for key, value in where.items())
        notes.append(f"Nothing matches --where {asked}.")
    return notes
