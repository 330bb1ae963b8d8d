"""One file for help: what a session was set to, what it did, and how it ended.

A bundle is a ZIP archive of a session's small files, its flight recordings and what
else is named, with bundle.json: what is in it, what was left out and why, and the last
seconds before each fault as numbers. `bundle_story` tells it; nothing in a bundle is
run or unpacked to be read.
"""

import hashlib
import io
import json
import tomllib
import zipfile
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import cast

import numpy as np

from acquisition.clock import SystemClock
from acquisition.errors import TrialFileError
from acquisition.files import UnfitFileError, read_regular
from acquisition.sample import MOTOR_FRESH_SHIFT, SAFETY_MODE_MASK, Flag, Record
from acquisition.trial_file.reader import TrialReader
from experiments import provenance
from experiments.session.data_files import (
    journal_line,
    parse_line,
    parse_object,
    write_new,
)
from experiments.session.states import Event
from experiments.session.store import JOURNAL_FILE, SessionFolder, iso_utc

MANIFEST = "bundle.json"
LARGEST = 64_000_000  # bytes of a file in it
MOST = 200_000_000  # bytes of all
HIDDEN = "(hidden)"
# Fields that name persons, hold what they wrote, or the paths of their folders.
_PERSONAL = frozenset(
    {
        *("operator", "witness", "who", "author"),
        *("note", "notes", "remark", "text"),
        "config",
    }
)
_OF_VERDICTS = _PERSONAL | {"reason"}
_PREFLIGHT = "preflight.json"  # its texts are the program's own, but for paths
_OF_SESSION = (
    "session.json",
    JOURNAL_FILE,
    _PREFLIGHT,
    "provenance.json",
    "conditions.json",
    "config.toml",
    "matrix.toml",
    "diff.patch",
)
Row = dict[str, object]
_STEP = 0.2  # s between two rows of the last seconds
_LAST = 2.0  # s
_ALL_MOTORS = 0x7F


@dataclass(slots=True)
class BundleContents:
    """What goes into a bundle.

    Attributes:
        files: content by name.
        left_out: why, by name.
        last: rows before a fault, by the name of its flight recording.
        is_redacted: names and notes of persons are hidden.
    """

    is_redacted: bool
    files: dict[str, bytes] = field(default_factory=dict[str, bytes])
    left_out: dict[str, str] = field(default_factory=dict[str, str])
    last: dict[str, list[Row]] = field(default_factory=dict[str, list[Row]])

    def add(self, name: str, path: Path) -> None:
        """Take a file, or note why it is not taken; a missing one is not spoken of."""
        room = min(LARGEST, MOST - sum(map(len, self.files.values())))
        try:
            content = read_regular(path, room, is_link_followed=False)
        except FileNotFoundError:
            return
        except UnfitFileError as error:
            self.left_out[name] = str(error)
            return
        except OSError as error:
            self.left_out[name] = error.strerror or str(error)
            return
        if not self.is_redacted:
            self.files[name] = content
        elif (hidden := _redacted(name, content)) is not None:
            self.files[name] = hidden
        else:
            self.left_out[name] = "may hold names"

    def add_flight(self, name: str, path: Path) -> None:
        """Take a flight recording, and its last seconds as numbers."""
        try:
            self.last[name] = last_seconds(path)
        except TrialFileError as error:
            self.left_out[f"last seconds of {name}"] = error.reason
        self.add(name, path)


def write_bundle(
    folder: SessionFolder, to: Path, others: Iterable[Path], *, is_redacted: bool
) -> BundleContents:
    """Write the bundle of a session to `to`, a new file; return what is in it.

    Args:
        folder: the session.
        to: the archive.
        others: files that belong to it, e.g. a log of the bus.
        is_redacted: hide names and notes of persons; what may hold them is left out.

    Raises:
        TrialFileError: `to` exists, or the disk is full or gone.
    """
    contents = BundleContents(is_redacted)
    for name in _OF_SESSION:
        contents.add(name, folder.path / name)
    for part in ("trials", "rejected"):
        for path in sorted((folder.path / part).glob("T*.json")):
            contents.add(f"{part}/{path.name}", path)
    for path in sorted((folder.path / "faults").glob("*.mcap")):
        contents.add_flight(f"faults/{path.name}", path)
    for number, path in enumerate(others, 1):
        contents.add(f"others/{number}_{path.name}", path.resolve())
    write_new(to, _archive(contents, _manifest(folder, contents)))
    return contents


def last_seconds(path: Path) -> list[Row]:
    """Return what the arm did before a flight recording ends, oldest first.

    Raises:
        TrialFileError: it is no sound recording.
    """
    rows = TrialReader(path).cycles().data
    if not len(rows):
        return []
    before = (rows["host_ns"].astype(np.int64) - int(rows["host_ns"][-1])) * 1e-9
    edges = np.arange(-_LAST, _STEP / 2, _STEP)
    return [
        _row(part, float(end))
        for begin, end in pairwise(edges)
        if len(part := rows[(before > begin) & (before <= end + 1e-9)])
    ]


def _row(part: Record, end: float) -> Row:
    v_t, F_t, F_n = (float(value) for value in part["traction"][-1])
    speeds, flags = np.abs(part["velocity"]), part["flags"]
    asked = flags[(flags & int(Flag.ARM_UNASKED)) == 0]
    fresh = (asked >> MOTOR_FRESH_SHIFT) & _ALL_MOTORS
    joint = int(np.unravel_index(speeds.argmax(), speeds.shape)[1])
    return {
        "t": round(end, 3) + 0.0,  # not minus zero
        "v_t": _plain(v_t),
        "F_t": _plain(F_t),
        "F_n": _plain(F_n),
        "fastest_joint": joint + 1,
        "speed": _plain(float(speeds[:, joint].max())),
        "torque": _plain(float(np.abs(part["torque_command"]).max())),
        "mode": int(flags[-1] & SAFETY_MODE_MASK),
        "incomplete": int(np.count_nonzero(fresh != _ALL_MOTORS)),
        "late": int(np.count_nonzero(flags & int(Flag.DEADLINE_MISSED))),
        "bus_errors": int(np.count_nonzero(flags & int(Flag.BUS_ERROR))),
    }


def _plain(value: float) -> float | None:
    return round(value, 4) if np.isfinite(value) else None


def _redacted(name: str, content: bytes) -> bytes | None:
    """Return a file of a session without what persons wrote; None = not known how."""
    if name == JOURNAL_FILE:
        events = enumerate(map(parse_line, content.splitlines()), 1)
        return b"".join(
            journal_line(_hidden_event(event), number)
            for number, event in events
            if event is not None
        )
    if name.startswith("others/"):
        return None
    if name.endswith(".toml"):
        return _without_comments(content)
    found = parse_object(content) if name.endswith(".json") else None
    if found is None:
        return None
    is_preflight = name == _PREFLIGHT
    shown = _hidden_paths(found) if is_preflight else _hidden(found, _OF_VERDICTS)
    return json.dumps(shown, indent=1).encode()


def _hidden_event(event: dict[str, object]) -> dict[str, object]:
    """Return an event of the journal; the reason of a later verdict is typed."""
    is_typed = event.get("event") == Event.VERDICT
    shown = _hidden(event, _OF_VERDICTS if is_typed else _PERSONAL)
    return cast("dict[str, object]", shown)


def _hidden_paths(preflight: Mapping[str, object]) -> dict[str, object]:
    """Return a preflight; the row that names rig.toml has the path of its folder."""
    checks = preflight.get("checks")
    rows = cast("list[object]", checks) if isinstance(checks, list) else []
    shown = [
        {**row, "text": HIDDEN} if row.get("name") == "config" else row
        for row in (cast("Row", row) for row in rows if isinstance(row, dict))
    ]
    return {**preflight, "checks": shown}


def _without_comments(content: bytes) -> bytes | None:
    """Return TOML that says the same without comments, None where that is not sure."""
    try:
        text = content.decode()
        shorter = "\n".join(map(_bare, text.splitlines())) + "\n"
        is_same = tomllib.loads(shorter) == tomllib.loads(text)
    except ValueError:
        return None
    return shorter.encode() if is_same else None


def _bare(line: str) -> str:
    """Return a line of TOML up to the first # that is in no quotes."""
    quote = ""
    for at, sign in enumerate(line):
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "\"'":
            quote = sign
        elif sign == "#":
            return line[:at].rstrip()
    return line


def _hidden(value: object, names: Collection[str]) -> object:
    """Return plain values in which the fields of these names are hidden."""
    if isinstance(value, dict):
        fields = cast("dict[str, object]", value)
        return {
            key: HIDDEN if key in names and item else _hidden(item, names)
            for key, item in fields.items()
        }
    if isinstance(value, list):
        return [_hidden(item, names) for item in cast("list[object]", value)]
    return value


def _manifest(folder: SessionFolder, contents: BundleContents) -> bytes:
    content = {
        "schema": 1,
        "session": folder.id,
        "terrain": folder.terrain,
        "simulated": folder.is_simulated,
        "made_utc": iso_utc(SystemClock().utc_ns()),
        "made_with": provenance.collect()["software"],
        "redacted": contents.is_redacted,
        "files": [
            {
                "name": name,
                "size": len(data),
                "sha256": hashlib.sha256(data).hexdigest(),
            }
            for name, data in contents.files.items()
        ],
        "left_out": contents.left_out,
        "last_seconds": contents.last,
    }
    return json.dumps(content, indent=1).encode()


def _archive(contents: BundleContents, manifest: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in _members(contents, manifest):
            archive.writestr(name, data)
    return buffer.getvalue()


def _members(contents: BundleContents, manifest: bytes) -> Iterator[tuple[str, bytes]]:
    yield MANIFEST, manifest
    yield from contents.files.items()
