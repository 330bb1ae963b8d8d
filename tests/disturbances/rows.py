"""Disturbances of a trial and their expected outcomes, as one table."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from acquisition.sample import Flag, Record
from analysis.data.series import Array
from ft_sensor.payload import Payload, TerrainFrame

T, V, N, F = range(4)  # columns of a table


class Outcome(Enum):
    """Outcome of a disturbed trial."""

    REFUSED = "refused"
    FLAGGED = "flagged"
    HARMLESS = "harmless"


@dataclass(frozen=True, slots=True)
class Recording:
    """The parts of a recorded trial that a disturbance changes."""

    cycles: Record
    payload: Payload
    frame: TerrainFrame
    sole: Array


@dataclass(frozen=True, slots=True)
class TableRow:
    """A disturbance of a table of t, v_t, F_n and F_t.

    Attributes:
        name: description of the disturbance.
        disturb: changes a table, shape (n, 4).
        outcome: expected outcome.
        word: part of the refusal or the warning; for a harmless disturbance the largest
            permitted relative change of F_t/F_n.
        terrain: terrain of the disturbed trial.
        header: header of the table, if it is a CSV.
    """

    name: str
    disturb: Callable[[Array], Array]
    outcome: Outcome
    word: str | float
    terrain: str = "S0"
    header: str = ""


@dataclass(frozen=True, slots=True)
class RecordingRow:
    """A disturbance of a recorded trial; attributes as in `TableRow`."""

    name: str
    disturb: Callable[[Recording], Recording]
    outcome: Outcome
    word: str | float


def times(column: int, factor: float) -> Callable[[Array], Array]:
    """A disturbance that multiplies a column."""

    def disturb(table: Array) -> Array:
        table[:, column] *= factor
        return table

    return disturb


def late(rows: int) -> Callable[[Array], Array]:
    """A disturbance that delays the forces by `rows` rows of 2 ms."""
    return lambda table: np.column_stack([table[rows:, :2], table[:-rows, 2:]])


def swapped(table: Array) -> Array:
    """Swap F_n and F_t."""
    return table[:, [T, V, F, N]]


def jumped(table: Array) -> Array:
    """Make the clock jump forward by a second in the middle."""
    table[len(table) // 2 :, T] += 1.0
    return table


def backward(table: Array) -> Array:
    """Set the clock back by a second in the middle."""
    table[len(table) // 2 :, T] -= 1.0
    return table


def clipped(table: Array) -> Array:
    """Clip the sensor at a third of its largest traction."""
    table[:, F] = np.minimum(table[:, F], table[:, F].max() / 3.0)
    return table


def with_gaps(table: Array) -> Array:
    """Remove the F_t of every tenth row."""
    table[::10, F] = np.nan
    return table


REFUSED, FLAGGED, HARMLESS = Outcome
TABLES = (
    TableRow("no disturbance", lambda table: table, HARMLESS, 0.0),
    TableRow("F_t with the wrong sign", times(F, -1.0), FLAGGED, "drives the foot"),
    TableRow(
        "F_n with the wrong sign", times(N, -1.0), FLAGGED, "pulls at the moving foot"
    ),
    TableRow("heading off by 180 degrees", times(V, -1.0), FLAGGED, "moves backward"),
    TableRow("v_t in mm/s", times(V, 1e3), REFUSED, "--unit v_t=mm/s"),
    TableRow("time in ms", times(T, 1e3), FLAGGED, "--unit t=ms"),
    TableRow("F_n in mN", times(N, 1e3), FLAGGED, "--unit F_n=mN"),
    TableRow("F_n in kN", times(N, 1e-3), FLAGGED, "--unit F_n=kN"),
    TableRow("F_t in mN, F_n in N", times(F, 1e3), FLAGGED, "outside 0.15 to 5"),
    TableRow("F_n and F_t swapped", swapped, FLAGGED, "swapped"),
    TableRow("F_n and F_t swapped, plate", swapped, FLAGGED, "swapped", "TF"),
    TableRow("force delayed by 20 ms", late(10), FLAGGED, "--what-if lag=2"),
    TableRow("force delayed by 8 ms", late(4), FLAGGED, "lag"),
    TableRow("force delayed by 500 ms", late(250), FLAGGED, "lag=50"),
    TableRow("clock jumps forward by 1 s", jumped, FLAGGED, "gap of 1"),
    TableRow("clock jumps back by 1 s", backward, REFUSED, "time does not increase"),
    TableRow("NaN in every tenth row", with_gaps, FLAGGED, "without a value"),
    TableRow(
        "every row duplicated", lambda x: np.repeat(x, 2, 0), FLAGGED, "duplicate rows"
    ),
    TableRow(
        "v_t, F_n and F_t zero", lambda x: x * [1.0, 0, 0, 0], REFUSED, "No sample"
    ),
    TableRow("only five rows", lambda x: x[:5], REFUSED, "No sample"),
    TableRow("100 Hz", lambda x: x[::5], FLAGGED, "100 Hz, not 500"),
    TableRow(
        "100 Hz, smooth plate", lambda x: x[::5], FLAGGED, "100 Hz, not 500", "TF"
    ),
    TableRow(
        "units stated in the header",
        times(V, 1e3),
        *(HARMLESS, 1e-6, "S0", "t [s],v_t [mm/s],F_n [N],F_t [N]"),
    ),
    TableRow(
        "unknown unit",
        times(V, 1.0),
        *(REFUSED, "not a unit", "S0", "t,v_t [kn],F_n,F_t"),
    ),
    TableRow(
        "duplicate column", times(V, 1.0), REFUSED, "twice", "S0", "t,F_n,F_n,F_t"
    ),
)


def turned(degrees: float) -> Callable[[Recording], Recording]:
    """A disturbance that rotates the sensor about its z axis, also during the tare."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    once = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    both = np.kron(np.eye(2), once)

    def disturb(recording: Recording) -> Recording:
        cycles, bias = recording.cycles.copy(), recording.payload.bias
        cycles["wrench_raw"] = (cycles["wrench_raw"] - bias) @ both.T + bias
        return replace(recording, cycles=cycles)

    return disturb


def heavier(share: float) -> Callable[[Recording], Recording]:
    """A disturbance that makes the foot heavier than stated, also during the tare."""

    def disturb(recording: Recording) -> Recording:
        payload = recording.payload
        other = replace(payload, mass=payload.mass / (1.0 + share))
        upright = np.diag([1.0, -1.0, -1.0])  # frame 7 points down at a tare
        missed = payload.weight(upright) - other.weight(upright)
        return replace(
            recording, payload=replace(other, bias=payload.bias + payload.sign * missed)
        )

    return disturb


def moved(**changes: float) -> Callable[[Recording], Recording]:
    """A disturbance of the stated container: error of incline or heading [degrees]."""

    def disturb(recording: Recording) -> Recording:
        frame = recording.frame
        angles = {
            name: getattr(frame, name) + np.radians(degrees)
            for name, degrees in changes.items()
        }
        return replace(recording, frame=replace(frame, **angles))

    return disturb


def longer(height: float) -> Callable[[Recording], Recording]:
    """A disturbance that mounts a foot longer than entered, by `height` [m]."""
    lower = np.array([0.0, 0.0, height])
    return lambda recording: replace(recording, sole=recording.sole - lower)


def tared_on_the_ground(recording: Recording) -> Recording:
    """Tare the foot while it presses on the ground with 8 N."""
    bias = recording.payload.bias.copy()
    bias[2] -= 8.0 * recording.payload.sign
    return replace(recording, payload=replace(recording.payload, bias=bias))


def of_cycles(change: Callable[[Record], None]) -> Callable[[Recording], Recording]:
    """A disturbance of the cycles."""

    def disturb(recording: Recording) -> Recording:
        cycles = recording.cycles.copy()
        change(cycles)
        return replace(recording, cycles=cycles)

    return disturb


def swap_moments(cycles: Record) -> None:
    cycles["wrench_raw"] = cycles["wrench_raw"][:, [0, 1, 2, 4, 3, 5]]


def flip_moments(cycles: Record) -> None:
    cycles["wrench_raw"] = cycles["wrench_raw"] * [1.0, 1.0, 1.0, -1.0, -1.0, -1.0]


def saturate(cycles: Record) -> None:
    rows = slice(len(cycles) // 2, None, 3)
    cycles["flags"][rows] |= np.uint32(Flag.FT_SATURATED)


def freeze(cycles: Record) -> None:
    half = len(cycles) // 2
    cycles["wrench_raw"][half:, 2] = cycles["wrench_raw"][half, 2]


def go_stale(cycles: Record) -> None:
    cycles["flags"][len(cycles) // 2 :: 2] &= ~np.uint32(Flag.FT_FRESH)


def jump(cycles: Record) -> None:
    cycles["host_ns"][len(cycles) // 2 :] += np.uint64(1_000_000_000)


def turn_foot(cycles: Record) -> None:
    cycles["position"][len(cycles) // 2 :, 6] += 0.1


def zero_wrong(cycles: Record) -> None:
    cycles["position"][:, 3] += np.radians(10.0)


RECORDINGS = (
    RecordingRow("no disturbance", lambda r: r, HARMLESS, 0.0),
    RecordingRow("sensor rotated by 180 degrees", turned(180.0), FLAGGED, "turned"),
    RecordingRow("sensor rotated by 90 degrees", turned(90.0), FLAGGED, "turned by 90"),
    RecordingRow("sensor rotated by 5 degrees", turned(5.0), HARMLESS, 0.03),
    RecordingRow("moment axes swapped", of_cycles(swap_moments), FLAGGED, "moment"),
    RecordingRow(
        "moments with the wrong sign",
        of_cycles(flip_moments),
        FLAGGED,
        "the force acts",
    ),
    RecordingRow("foot 5 % heavier than entered", heavier(0.05), HARMLESS, 0.01),
    RecordingRow("foot 20 % heavier than entered", heavier(0.2), HARMLESS, 0.03),
    RecordingRow("foot 30 mm longer than entered", longer(0.03), HARMLESS, 0.01),
    RecordingRow(
        "tare with the foot on the ground", tared_on_the_ground, FLAGGED, "tare"
    ),
    RecordingRow("incline off by 10 degrees", moved(incline=10.0), FLAGGED, "incline"),
    RecordingRow("incline off by 2 degrees", moved(incline=2.0), HARMLESS, 0.15),
    RecordingRow("heading off by 10 degrees", moved(heading=10.0), FLAGGED, "heading"),
    RecordingRow("heading off by 4 degrees", moved(heading=4.0), HARMLESS, 0.02),
    RecordingRow("axis saturated", of_cycles(saturate), FLAGGED, "saturated"),
    RecordingRow("F_z frozen", of_cycles(freeze), FLAGGED, "Fz stands"),
    RecordingRow("force samples stale", of_cycles(go_stale), FLAGGED, "stale"),
    RecordingRow("clock jumps forward by 1 s", of_cycles(jump), FLAGGED, "worst gap"),
    RecordingRow(
        "foot rotated by 0.1 rad (loose)", of_cycles(turn_foot), FLAGGED, "joint 7"
    ),
    RecordingRow(
        "zero of joint 4 off by 10 degrees", of_cycles(zero_wrong), HARMLESS, 0.08
    ),
)
