"""What was read of sessions and of the matrix, kept in the user's cache folder.

The file saves time and nothing else: it may be deleted, and one that is damaged, too
large, or somebody else's is not read. What it says of a session holds as long as no
file of the session has changed by what the file system tells of it, and only sessions
without any deviation are in it. `traction verify` never looks here.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from acquisition.clock import SystemClock
from acquisition.files import (
    UnfitFileError,
    open_directory,
    open_regular,
    replace_file,
)
from experiments.status_table.session_summaries import (
    SessionSummary,
    glance,
    signature_of,
    summarise,
)

if TYPE_CHECKING:
    from analysis.data.terrain_kinds import Value
    from experiments.session.store import SessionFolder
    from experiments.settings.matrix import MatrixSettings, TerrainRow

_FORMAT = 2
_LARGEST = 16 * 2**20  # bytes; a thousand sessions take 0.3 MB
_SETTLED_NS = 2_000_000_000  # a change within one tick of the clock has no other time
_TRIAL = re.compile(r"T\d\d[a-z]*")


@dataclass(frozen=True, slots=True)
class StatusRow:
    """A row of the matrix as the table needs it; names are those of TerrainRow."""

    name: str
    stones: str
    incline_deg: float
    foot: str
    trials: int
    kind: str
    target: str
    push_deg: int = 0
    place: str | None = None
    factors: Mapping[str, Value] = field(default_factory=dict[str, "Value"])
    blocks: int = 1


@dataclass(frozen=True, slots=True)
class StatusMatrix:
    """The matrix as the table needs it.

    Attributes:
        rows: its terrains.
        order: randomised, rows or blocked.
        block_by: keys of the rows that are done in one go.
        logs: factors that are compared by their logarithm.
        seed: of the draws.
    """

    rows: tuple[StatusRow, ...]
    order: str = "randomised"
    block_by: tuple[str, ...] = ()
    logs: tuple[str, ...] = ()
    seed: int = 1


def row_of(row: TerrainRow, blocks: int = 1) -> StatusRow:
    """Return what the table needs of a row of the matrix.

    Args:
        row: the row.
        blocks: how often its trials are recorded.
    """
    names = [each.name for each in fields(StatusRow) if each.name != "blocks"]
    return StatusRow(**{name: getattr(row, name) for name in names}, blocks=blocks)


def matrix_of(matrix: MatrixSettings) -> StatusMatrix:
    """Return what the table needs of the matrix."""
    design = matrix.design
    return StatusMatrix(
        rows=tuple(row_of(row, 1 + design.repeat_blocks) for row in matrix.terrains),
        order=design.order,
        block_by=design.block_by,
        logs=tuple(f.name for f in matrix.factors if f.scale == "log"),
        seed=design.seed,
    )


def cache_path(data: Path) -> Path:
    """Return the file that keeps what was read of the sessions in `data`."""
    home = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not home.is_absolute():
        home = Path.home() / ".cache"
    name = hashlib.sha256(os.fsencode(data.absolute())).hexdigest()[:32]
    return home / "traction" / f"board-{name}.json"  # the file's name stays


class SummaryCache:
    """Summaries of sessions and rows of a matrix, read again only where they changed.

    Args:
        path: the file; None keeps everything in memory.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        known = _load(path) if path is not None else {}
        self._sessions = _mapping(known.get("sessions"))
        self._matrices = _mapping(known.get("matrices"))
        self._seen: dict[str, object] = {}
        self._is_changed = False

    def summary(self, folder: SessionFolder) -> SessionSummary:
        """Return the summary of a session, computed only if a file of it changed."""
        before, newest = _signature_of(folder.path)
        known = self._known(folder, before)
        if known is not None:
            return known
        summary = summarise(folder)
        is_settled = newest + _SETTLED_NS < SystemClock().utc_ns()
        if before and summary.is_sound and is_settled:
            self._remember(folder, before, summary)
        return summary

    def glance(self, folder: SessionFolder) -> SessionSummary:
        """Return the same where it is known, else a summary without any checksum."""
        known = self._known(folder, _signature_of(folder.path)[0])
        return glance(folder) if known is None else known

    def _known(self, folder: SessionFolder, signature: str) -> SessionSummary | None:
        entry = self._sessions.get(folder.path.name)
        known = _summary_of(entry, signature) if signature else None
        if known is not None:
            self._seen[folder.path.name] = entry
        return known

    def _remember(
        self, folder: SessionFolder, before: str, summary: SessionSummary
    ) -> None:
        """Keep a summary, unless a file changed while it was computed."""
        if _signature_of(folder.path)[0] == before:
            entry = [before, _plain(summary)]
            self._sessions[folder.path.name] = self._seen[folder.path.name] = entry
            self._is_changed = True

    def matrix(
        self, texts: Sequence[bytes] | None, read: Callable[[], MatrixSettings]
    ) -> StatusMatrix:
        """Return the matrix, read only if the texts of the settings changed.

        Args:
            texts: the contents of the settings files; None where they are not known.
            read: what reads and checks the settings; what it raises is passed on.
        """
        if texts is None:
            return matrix_of(read())
        digests = [hashlib.sha256(text).hexdigest() for text in texts]
        key = hashlib.sha256(" ".join(digests).encode()).hexdigest()
        known = _matrix_of(self._matrices.get(key))
        if known is None:
            known = matrix_of(read())
            self._matrices = {key: asdict(known)}
            self._is_changed = True
        return known

    def save(self) -> None:
        """Write what is new to the file; one that cannot be written costs only time."""
        if self._path is None or not self._is_changed:
            return
        content = {"sessions": self._seen, "matrices": self._matrices}
        body = json.dumps({"format": _FORMAT, **content}).encode()
        if len(body) > _LARGEST:
            return
        digest = hashlib.sha256(body).hexdigest().encode()
        with contextlib.suppress(OSError):
            _replace(self._path, digest + b"\n" + body)
            self._is_changed = False


def _signature_of(folder: Path) -> tuple[str, int]:
    try:
        return signature_of(folder)
    except OSError:
        return "", 0


def _replace(path: Path, content: bytes) -> None:
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with open_directory(path.parent) as folder:
        replace_file(folder, path.name, content, mode=0o600)


def _load(path: Path) -> dict[str, Any]:
    """Return what the file holds, nothing where it is not to be believed."""
    try:
        with open_regular(path) as file:
            status = os.fstat(file.fileno())
            if status.st_uid != os.geteuid() or status.st_mode & 0o022:
                return {}
            content = file.read(_LARGEST + 100)
    except (OSError, UnfitFileError):
        return {}
    digest, _, body = content.partition(b"\n")
    if len(body) > _LARGEST or hashlib.sha256(body).hexdigest().encode() != digest:
        return {}
    try:
        value: object = json.loads(body)
    except (ValueError, RecursionError):
        return {}
    known = _mapping(value)
    return known if known.get("format") == _FORMAT else {}


def _mapping(value: object) -> dict[str, Any]:
    return cast("dict[str, Any]", value) if isinstance(value, dict) else {}


def _plain(summary: SessionSummary) -> Mapping[str, object]:
    kept = {**_COUNTED, **_STATED, **_WORDS}
    return {"kept": list(summary.kept)} | {k: getattr(summary, k) for k in kept}


_COUNTED: Mapping[str, type] = {"pushes": int, "rejected": int}
_STATED: Mapping[str, type] = {"is_resumable": bool}
_WORDS: Mapping[str, type] = {"operator": str, "phase": str}


def _summary_of(entry: object, signature: str) -> SessionSummary | None:
    """Return the summary in an entry of this signature, None where there is none."""
    parts = cast("list[object]", entry) if isinstance(entry, list) else []
    if len(parts) != 2 or parts[0] != signature:
        return None
    values = _mapping(parts[1])
    kinds = {"kept": list, **_COUNTED, **_STATED, **_WORDS}
    if {name: type(value) for name, value in values.items()} != kinds:
        return None
    if any(values[name] < 0 for name in _COUNTED):
        return None
    names = cast("list[object]", values["kept"])
    kept = tuple(name for name in names if isinstance(name, str))
    if len(kept) != len(names) or not all(map(_TRIAL.fullmatch, kept)):
        return None
    values["kept"] = kept
    return SessionSummary(**values)


_ROW: Mapping[str, tuple[type, ...]] = {
    "name": (str,),
    "stones": (str,),
    "incline_deg": (float,),
    "foot": (str,),
    "trials": (int,),
    "kind": (str,),
    "target": (str,),
    "push_deg": (int,),
    "place": (str, type(None)),
    "factors": (dict,),
    "blocks": (int,),
}


def _matrix_of(value: object) -> StatusMatrix | None:
    """Return the matrix in an entry, None where it holds anything else."""
    entry = _mapping(value)
    rows = tuple(map(_row_of, _list(entry.get("rows"))))
    block_by, logs = (_list(entry.get(name)) for name in ("block_by", "logs"))
    order, seed = entry.get("order"), entry.get("seed")
    words = [order, *block_by, *logs]
    if type(seed) is not int or not all(isinstance(word, str) for word in words):
        return None
    known = tuple(row for row in rows if row is not None)
    if not known or len(known) < len(rows):
        return None
    texts = tuple(map(str, block_by)), tuple(map(str, logs))
    return StatusMatrix(known, str(order), *texts, seed)


def _row_of(value: object) -> StatusRow | None:
    row = _mapping(value)
    if set(row) != set(_ROW):
        return None
    if any(type(row[name]) not in kinds for name, kinds in _ROW.items()):
        return None
    plain = (str, float, type(None))
    if any(type(each) not in plain for each in row["factors"].values()):
        return None
    return StatusRow(**row)


def _list(value: object) -> list[object]:
    return cast("list[object]", value) if isinstance(value, list) else []
