"""The matrix board: kept trials per terrain, counted from verified files only."""

import math
import os
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from acquisition import SettingsError, TrialFileError
from experiments.arguments import data_option
from experiments.session.data_files import read_json, sha256_of
from experiments.session.kept_files import (
    Deviation,
    compare_kept,
    enough_of,
    unreadable,
)
from experiments.session.lock import owner_of
from experiments.session.store import SessionFolder, list_sessions
from experiments.session.unfinished import find_unfinished
from experiments.settings import MatrixSettings, TerrainRow

KEYS = ("terrain", "stones", "incline_deg", "foot", "kind", "session", "operator")
_Digest = Callable[[Path], str]


@dataclass(frozen=True, slots=True)
class MatrixRow:
    """One terrain, live or simulated: what is kept of what is wanted.

    Attributes:
        terrain: its name.
        is_simulated: trials of simulated devices.
        kept: how many verified trials are kept.
        wanted: how many there are to be.
        rejected: how many attempts were rejected or interrupted.
        sessions: ids of the sessions.
        trials: in how many sessions T01, T02 ... are kept, in this order.
    """

    terrain: str
    is_simulated: bool
    kept: int
    wanted: int
    rejected: int
    sessions: tuple[str, ...]
    trials: tuple[int, ...]

    def as_dict(self) -> dict[str, object]:
        """Return the line for JSON."""
        return asdict(self)

    def cells(self) -> str:
        """Return one sign per trial: kept, kept in several sessions, missing."""
        signs = {0: "·", 1: "█"}
        return "".join(signs.get(n, str(min(n, 9))) for n in self.trials)


class DigestCache:
    """Checksums, computed once as long as a file does not change."""

    def __init__(self) -> None:
        self._known: dict[tuple[Path, int, int, int], str] = {}

    def __call__(self, path: Path) -> str:
        """Return the hex digest of `path`."""
        stat = path.stat()
        key = (path, stat.st_ino, stat.st_size, stat.st_mtime_ns)
        if key not in self._known:
            self._known[key] = sha256_of(path)
        return self._known[key]


def count_board(
    data: Path,
    matrix: MatrixSettings,
    where: Mapping[str, str] | None = None,
    digest: _Digest = sha256_of,
) -> list[MatrixRow]:
    """Return a line per terrain of the matrix, live first, simulated where there is.

    Args:
        data: the data folder.
        matrix: the terrains.
        where: only terrains and sessions with these values, by a name of `KEYS`.
        digest: what computes the checksum of a file.
    """
    where = where or {}
    sessions = [
        s for s in _readable(list_sessions(data)) if _matches(_of_session(s), where)
    ]
    lines: list[MatrixRow] = []
    for row in matrix.terrains:
        if not _matches(_of_row(row), where):
            continue
        for is_simulated in (False, True):
            own = [
                s
                for s in sessions
                if s.terrain == row.name and s.is_simulated is is_simulated
                if not s.is_of_stances
            ]
            is_wanted = not is_simulated and where.get("kind") != "simulated"
            if own or (is_wanted and not {"session", "operator"} & set(where)):
                lines.append(_line(row, own, digest, is_simulated=is_simulated))
    return lines


def compare_board(
    data: Path, where: Mapping[str, str], digest: _Digest = sha256_of
) -> list[Deviation]:
    """Return what is missing or changed of the kept trials on the board.

    Args:
        data: the data folder.
        where: only sessions with these values, as in `count_board`.
        digest: what computes the checksum of a file.
    """
    every = list_sessions(data)
    readable = _readable(every)
    sessions = [
        s for s in every if s not in readable or _matches(_of_session(s), where)
    ]
    conditions = [d for session in sessions for d in compare_kept(session, digest)]
    return list(dict.fromkeys(conditions + [d for s in every for d in _hostile(s)]))


def _hostile(session: SessionFolder) -> list[Deviation]:
    """Return what of a session cannot be looked at because it leads out of it."""
    try:
        session.kept_trials(lambda _: "")
        session.rejected_sidecars()
        owner_of(session)
        read_json(session.path / "session.json")
    except TrialFileError as error:
        return [unreadable(session, error)]
    return []


def _readable(sessions: Sequence[SessionFolder]) -> list[SessionFolder]:
    """Return the sessions that hold nothing which leads out of them."""
    return [session for session in sessions if not _hostile(session)]


def parse_where(text: str) -> dict[str, str]:
    """Return the conditions in `K=V,K=V`.

    Raises:
        SettingsError: it is not of that form, or a key is unknown.
    """
    conditions: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        key, sign, value = part.partition("=")
        if key not in KEYS or not sign or not value:
            raise SettingsError(
                f"--where {part!r} - expected KEY=VALUE, e.g. kind=live.",
                hint=f"Keys: {', '.join(KEYS)}.",
            )
        conditions[key] = value
    return conditions


def next_steps(data: Path, matrix: MatrixSettings, *, is_simulated: bool) -> list[str]:
    """Return what others have open, what is to be resumed, which terrain comes next."""
    steps: list[str] = []
    sessions = _readable(list_sessions(data))
    sessions = [s for s in sessions if s.is_simulated is is_simulated]
    for session in sessions:
        owner = owner_of(session)
        if owner is not None and owner.pid != os.getpid():
            phase = read_json(session.path / "session.json").get("phase", "opening")
            steps.append(
                f"{session.id} {session.terrain} is open in process {owner.pid} since "
                f"{owner.since} UTC: {phase}."
            )
    left = [u for u in find_unfinished(data) if u.folder.is_simulated is is_simulated]
    option = data_option(data)
    steps += [
        f"{u.text()} To go on: traction resume {u.folder.id}{option}" for u in left
    ]
    order = suggest_order(
        matrix.terrains, [s.terrain for s in sessions if not s.is_of_stances]
    )
    if order:
        steps.append(f"Suggested order, randomised against drift: {' '.join(order)}")
    return steps


def enough_lines(
    data: Path, matrix: MatrixSettings, where: Mapping[str, str]
) -> list[str]:
    """Return the terrains whose kept trials are enough for their target.

    Args:
        data: the data folder.
        matrix: the terrains and their targets.
        where: only these, as in `count_board`.
    """
    sessions = [
        s for s in _readable(list_sessions(data)) if _matches(_of_session(s), where)
    ]
    rows = [row for row in matrix.terrains if _matches(_of_row(row), where)]
    sessions = [s for s in sessions if not s.is_of_stances]
    told = [enough_of(sessions, r, is_simulated=k) for r in rows for k in (False, True)]
    return [text for text in told if text]


def _of_session(session: SessionFolder) -> dict[str, str]:
    fields = read_json(session.path / "session.json")
    return {
        "kind": "simulated" if session.is_simulated else "live",
        "session": session.id,
        "operator": str(fields.get("operator", "")),
    }


def _of_row(row: TerrainRow) -> dict[str, str]:
    incline = f"{row.incline_deg:g}"
    return {
        "terrain": row.name,
        "stones": row.stones,
        "incline_deg": incline,
        "foot": row.foot,
    }


def _matches(fields: Mapping[str, str], where: Mapping[str, str]) -> bool:
    """Return whether every fact that is asked for has the value."""
    return all(fields[key] == value for key, value in where.items() if key in fields)


def _line(
    row: TerrainRow,
    sessions: Sequence[SessionFolder],
    digest: _Digest,
    *,
    is_simulated: bool,
) -> MatrixRow:
    kept = [path.stem for s in sessions for path in s.kept_trials(digest)]
    names = [f"T{number:02d}" for number in range(1, row.trials + 1)]
    return MatrixRow(
        terrain=row.name,
        is_simulated=is_simulated,
        kept=len(kept),
        wanted=row.trials,
        rejected=sum(len(session.rejected_sidecars()) for session in sessions),
        sessions=tuple(session.id for session in sessions),
        trials=tuple(kept.count(name) for name in names),
    )


_DRAWS = 400
_SEED = 1  # the same data give the same advice


def suggest_order(rows: Sequence[TerrainRow], done: Sequence[str]) -> list[str]:
    """Return the terrains still to be recorded in a good order.

    A foot that wears, a sensor that drifts and a person who learns change with time.
    If the inclines came in rising order, these could not be told from the incline. So
    of many random orders that one is taken in which inclination, size of the stones
    and tread go least with the place in the whole sequence.

    Args:
        rows: the matrix.
        done: names of the terrains recorded so far, oldest first.
    """
    factors = {row.name: _factors(row) for row in rows}
    begun = [name for name in done if name in factors]
    rest = [row.name for row in rows if row.name not in begun]
    dice = random.Random(_SEED)
    orders = [dice.sample(rest, len(rest)) for _ in range(_DRAWS)]
    return min(orders, key=lambda order: confounding([*begun, *order], factors))


def confounding(order: Sequence[str], factors: Mapping[str, Sequence[float]]) -> float:
    """Return the largest |correlation| of a factor with the place in `order`."""
    columns = zip(*(factors[name] for name in order), strict=True)
    places = [float(place) for place in range(len(order))]
    return max((abs(_correlation(places, list(c))) for c in columns), default=0.0)


def _factors(row: TerrainRow) -> tuple[float, ...]:
    """Return inclination and, as 0 or 1: big stones, a plate, a bare foot."""
    signs = (row.stones == "big", row.stones == "none", row.foot == "bare")
    return (row.incline_deg, *map(float, signs))


def _correlation(x: Sequence[float], y: Sequence[float]) -> float:
    """Return Pearson's correlation, 0 where one of them does not vary."""
    mean_x, mean_y = math.fsum(x) / len(x), math.fsum(y) / len(y)
    products = [(a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True)]
    squares_x = math.fsum((a - mean_x) ** 2 for a in x)
    squares_y = math.fsum((b - mean_y) ** 2 for b in y)
    if squares_x <= 0.0 or squares_y <= 0.0:
        return 0.0
    return math.fsum(products) / math.sqrt(squares_x * squares_y)
