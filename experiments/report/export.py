"""Trials as tables that any program reads: CSV, a data dictionary, checksums."""

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import SessionError, TrialFileError
from analysis.data import PrepareOptions, RecordedTrial, load_trial, prepare_trial
from experiments.operator import WARNING, Console
from experiments.session import SessionFolder, sha256_of, write_new_text

DICTIONARY, INDEX, SUMS = "data_dictionary.csv", "trials.csv", "SHA256SUMS"
_FORMAT = "%.12g"  # beyond the resolution of every instrument here
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # how a formula begins
_JOINTS = tuple(str(joint) for joint in range(1, 8))
_AXES = ("x", "y", "z")
_WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
_OF_TRIAL, _OF_SAMPLES = "T01.csv", "T01.kept.csv"
_BASE, _TERRAIN = "arm's base", "terrain"
_Columns = NDArray[np.float64]
_METADATA = (
    "operator",
    "started_utc",
    "incline_deg",
    "stone_size",
    "tread",
    "simulated",
)


@dataclass(frozen=True, slots=True)
class Quantity:
    """One or more columns of a trial's table.

    Attributes:
        names: of the columns.
        unit: of all of them.
        frame: where they are measured.
        meaning: what they are.
        values: takes them from a trial, shape (n,) or (n, columns).
    """

    names: tuple[str, ...]
    unit: str
    frame: str
    meaning: str
    values: Callable[[RecordedTrial], NDArray[np.generic]]

    def headers(self) -> list[str]:
        """Return the names with their unit, as in the first line of a table."""
        return [f"{name} [{self.unit}]" for name in self.names]


def _cycle(field: str) -> Callable[[RecordedTrial], NDArray[np.generic]]:
    return lambda trial: trial.cycles[field]


def _of_joints(prefix: str) -> tuple[str, ...]:
    return tuple(prefix + joint for joint in _JOINTS)


QUANTITIES = (
    Quantity(("t",), "s", "host clock", "since the first cycle", lambda x: x.t),
    Quantity(("cycle",), "1", "loop", "number of the cycle", _cycle("cycle")),
    Quantity(("flags",), "bits", "loop", "bits 0-2 safety mode", _cycle("flags")),
    Quantity(_of_joints("q"), "rad", "joints 1..7", "position", _cycle("position")),
    Quantity(_of_joints("qd"), "rad/s", "joints 1..7", "velocity", _cycle("velocity")),
    Quantity(
        _of_joints("tau"), "N m", "joints 1..7", "as sent", _cycle("torque_command")
    ),
    Quantity(
        tuple(f"raw_{name}" for name in _WRENCH),
        "N or N m",
        "sensor",
        "as read, not tared; f forces, t torques",
        _cycle("wrench_raw"),
    ),
    Quantity(
        tuple(f"sole_{axis}" for axis in _AXES),
        "m",
        _BASE,
        "centre of the sole",
        lambda x: x.sole,
    ),
    Quantity(
        tuple(f"v_{axis}" for axis in _AXES),
        "m/s",
        _BASE,
        "velocity of the sole; nan beside gaps",
        lambda x: x.velocity,
    ),
    Quantity(
        tuple(f"F_{axis}" for axis in _AXES),
        "N",
        _BASE,
        "force of the ground on the foot",
        lambda x: x.force,
    ),
    Quantity(
        ("travelled",),
        "m",
        _TERRAIN,
        "distance of the sole from the far end",
        lambda x: x.displacement,
    ),
    Quantity(
        ("v_t",),
        "m/s",
        _TERRAIN,
        "slip velocity, > 0 in ordinary slip",
        lambda x: x.traction[:, 0],
    ),
    Quantity(
        ("F_t",),
        "N",
        _TERRAIN,
        "traction force, > 0 against ordinary slip",
        lambda x: x.traction[:, 1],
    ),
    Quantity(
        ("F_n",),
        "N",
        _TERRAIN,
        "normal force, > 0 in compression",
        lambda x: x.traction[:, 2],
    ),
)
# Smoothed, thinned and inside the window of velocities: what models are fitted to.
SAMPLES = (
    ("t", "s", "since the first cycle"),
    ("v_t", "m/s", "slip velocity, smoothed"),
    ("F_n", "N", "normal force, smoothed"),
    ("F_t", "N", "traction force, smoothed"),
    ("kept_row", "1", "row of the trial's table, from 0"),
)


def export_sessions(
    sessions: Sequence[SessionFolder], to: Path, console: Console
) -> None:
    """Write the kept trials of `sessions` below `to`, which must be empty.

    Per trial a table at 500 Hz and one of the kept samples; an index of the trials, a
    data dictionary, and checksums that `sha256sum -c` reads.

    Raises:
        SessionError: `to` holds something, or no session has a kept trial.
        TrialFileError: a trial cannot be read, or a table cannot be written.
    """
    paths = [(session, path) for session in sessions for path in session.kept_trials()]
    if not paths:
        raise SessionError(f"{', '.join(s.id for s in sessions)}: no kept trials.")
    _make_empty(to)
    rows: list[list[str]] = []
    for session, path in paths:
        trial = load_trial(path)
        name = f"{session.path.name}/{path.stem}"
        (to / session.path.name).mkdir(exist_ok=True)
        write_new_text(to / f"{name}.csv", trial_table(trial))
        write_new_text(to / f"{name}.kept.csv", samples_table(trial))
        metadata = trial.metadata["trial"]
        values = [metadata.get(key, "") for key in _METADATA]
        rows.append([f"{name}.csv", session.id, trial.terrain, *values])
        rows[-1].append(sha256_of(path))
        console.say(f"{name}: {len(trial.t)} rows")
    header = ["table", "session", "terrain", *_METADATA, "sha256 of the recording"]
    write_new_text(to / INDEX, _csv([header, *rows]))
    write_new_text(to / DICTIONARY, data_dictionary())
    _write_sums(to)
    if sessions[0].is_simulated:
        console.say(f"{WARNING} SIMULATED: trials.csv says so in every row.")
    console.say(f"{len(rows)} trials in {to}. To check: cd {to} && sha256sum -c {SUMS}")


def trial_table(trial: RecordedTrial) -> str:
    """Return every cycle of a trial as CSV, units in the header."""
    columns = [np.asarray(q.values(trial), dtype=np.float64) for q in QUANTITIES]
    headers = [header for q in QUANTITIES for header in q.headers()]
    return _table(headers, np.column_stack(columns))


def samples_table(trial: RecordedTrial) -> str:
    """Return the kept samples of a trial as CSV, units in the header."""
    options = PrepareOptions(container_travel=trial.frame.travel)
    kept = prepare_trial(trial.series(), options)
    columns = (
        *(kept.smooth.t[kept.indices], kept.v_t, kept.F_n, kept.F_t),
        kept.indices.astype(float),
    )
    headers = [f"{name} [{unit}]" for name, unit, _ in SAMPLES]
    return _table(headers, np.column_stack(columns))


def data_dictionary() -> str:
    """Return what every column means, as CSV."""
    rows = [["table", "column", "unit", "frame", "meaning"]]
    for q in QUANTITIES:
        rows += [[_OF_TRIAL, name, q.unit, q.frame, q.meaning] for name in q.names]
    for name, unit, meaning in SAMPLES:
        rows.append([_OF_SAMPLES, name, unit, _TERRAIN, meaning])
    return _csv(rows)


def _table(headers: Sequence[str], columns: _Columns) -> str:
    text = io.StringIO()
    np.savetxt(
        text,
        columns,
        fmt=_FORMAT,
        delimiter=",",
        header=",".join(headers),
        comments="",
    )
    return text.getvalue()


def _csv(rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    plain = [[plain_cell(cell) for cell in row] for row in rows]
    csv.writer(text, lineterminator="\n").writerows(plain)
    return text.getvalue()


def plain_cell(cell: str) -> str:
    """Return a text that no spreadsheet takes for a formula; numbers stay."""
    try:
        float(cell)
    except ValueError:
        return "'" + cell if cell.startswith(_FORMULA) else cell
    return cell


def _make_empty(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        is_empty = not any(folder.iterdir())
    except OSError as error:
        raise TrialFileError(folder, f"cannot be made ({error.strerror})") from error
    if not is_empty:
        raise SessionError(
            f"{folder} is not empty.",
            hint="Name a new folder; nothing is ever overwritten.",
        )


def _write_sums(folder: Path) -> None:
    files = sorted(path for path in folder.rglob("*.csv"))
    lines = [f"{sha256_of(path)}  {path.relative_to(folder)}\n" for path in files]
    write_new_text(folder / SUMS, "".join(lines))
