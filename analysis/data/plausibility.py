"""Plausibility checks of a trial: signs, directions, units; pure.

The ground slows a slipping foot, presses on it along the normal, and pushes it sideways
less than along its path. A sensor mounted or calibrated differently, a swapped column
or a wrong unit violates one of these, and no fit would notice.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.data.frozen_channels import frozen_channels
from analysis.data.load import RecordedTrial
from analysis.data.prepare import PreparedTrial, Smoothed
from analysis.data.series import Array
from analysis.data.tare_bracket import LARGEST_CHANGE

SLOWEST = 0.005  # m/s; a slower foot sticks, and its force may point anywhere
PRESSED = 1.0  # N below which the direction of a force is sensor noise
_REST = 0.2  # s at rest before the foot first moves
FEWEST = 20  # moving samples below which nothing is judged
FRICTION = (0.15, 5.0)  # F_t over F_n; a smooth plate has 0.18 in some trials
LATEST_MS = 3.0  # lag of the force beyond the age in its time stamps
SHORTEST = 0.05  # m of travel below which the path has no clear direction
UNEVEN = 0.010  # m by which stones deflect a foot, however short its path
HEADING, INCLINE = 5.0, 4.0  # degrees that the path may differ from the container's
FARTHEST = 0.08  # m from the sole's centre to the centre of pressure
FREE_MOMENT = 0.03  # moment along the force over the force [m]
# Limits beyond which a column is probably in another unit.
_FASTEST, _STRONGEST, _WEAKEST, _RAREST = 2.0, 500.0, 0.02, 0.2

# Remedies for a table from another program, whose sensor cannot be recalibrated.
_OF_TABLES = {
    "power": "--negate F_t",
    "ratio": "--negate F_t",
    "normal": "--negate F_n",
    "direction": "--negate v_t",
    "friction": "--columns F_n=...,F_t=...",
}
_TURNED = "the sensor is turned by 180 degrees about z, or F_t has the other sign"

DoubtName = Literal[
    "power",
    "ratio",
    "no-traction",
    "direction",
    "normal",
    "friction",
    "lateral",
    "moment",
    "unit",
    "lag",
    "swapped",
    "incline",
    "heading",
    "pressure",
    "frozen",
    "zero",
]


@dataclass(frozen=True, slots=True)
class Doubt:
    """One reason why a trial cannot be what it says it is.

    Attributes:
        name: which one.
        seen: the observation, with the number.
        cause: the likely cause.
        remedy: what to do.
    """

    name: DoubtName
    seen: str
    cause: str
    remedy: str = "traction calibrate sensor"

    @property
    def text(self) -> str:
        """Observation, likely cause and remedy in one line."""
        return f"{self.seen}; likely: {self.cause}: {self.remedy}"


def doubts_of(trial: PreparedTrial) -> list[Doubt]:
    """Check velocity and forces of a prepared trial; empty if they are plausible."""
    doubts = _doubts_of(trial)
    if not trial.is_foreign:
        return doubts
    return [replace(d, remedy=_OF_TABLES.get(d.name, d.remedy)) for d in doubts]


def _doubts_of(trial: PreparedTrial) -> list[Doubt]:
    smooth = trial.smooth
    units = list(_units(smooth))
    if units:
        return units
    late = list(_timing(trial))
    if _is_numbered(smooth):
        late.append(_NUMBERED)
    sliding = (np.abs(smooth.v_t) > SLOWEST) & (np.abs(smooth.F_n) > PRESSED)
    if np.count_nonzero(sliding) < FEWEST:
        return late
    v, load, along = smooth.v_t[sliding], smooth.F_n[sliding], smooth.F_t[sliding]
    return [*late, *_normal(load), *_signs(v, load, along)]


def doubts_of_record(recorded: RecordedTrial) -> list[Doubt]:
    """Check a recording against a foot that is pushed along x_T.

    Covers what v_t, F_n and F_t do not show: the lateral force, the moment and the path
    of the sole.
    """
    v_t, F_t, F_n = recorded.traction.T
    sensor = [*_frozen(recorded), *_zero(recorded)]
    moving = (np.abs(v_t) > SLOWEST) & (F_n > PRESSED)
    if np.count_nonzero(moving) < FEWEST:
        return sensor
    raw = np.ascontiguousarray(recorded.cycles["wrench_raw"][moving])
    wrench = recorded.payload.contact(raw, recorded.rotation[moving])
    return [
        *sensor,
        *_path(recorded, moving),
        *_sideways(recorded.lateral[moving], F_t[moving]),
        *moment_doubts(wrench[:, :3], wrench[:, 3:]),
        *_pressure(recorded, wrench),
    ]


def doubt_summary(judged: Iterable[tuple[str, Sequence[Doubt]]]) -> list[str]:
    """Summarise the doubts of many trials, one line per kind.

    Args:
        judged: (name of the trial, its doubts), in the order of the trials.
    """
    by_name: dict[str, list[tuple[str, Doubt]]] = {}
    for trial, doubts in judged:
        for doubt in doubts:
            by_name.setdefault(doubt.name, []).append((trial, doubt))
    return [
        f"{', '.join(trial for trial, _ in entries[:5])}"
        f"{' and others' if len(entries) > 5 else ''}: {entries[0][1].text}."
        for entries in by_name.values()
    ]


def _units(smooth: Smoothed) -> Iterator[Doubt]:
    fastest = float(np.quantile(np.abs(smooth.v_t), 0.9))
    strongest = float(np.quantile(np.abs(smooth.F_n), 0.9))
    step = float(np.median(np.diff(smooth.t)))
    for name, value, limit, unit, looks in (
        ("v_t", fastest, _FASTEST, "m/s", "mm/s"),
        ("F_n", strongest, _STRONGEST, "N", "mN"),
        (
            "t",
            0.0 if _is_numbered(smooth) else step,
            _RAREST,
            "s between samples",
            "ms",
        ),
    ):
        if value > limit:
            yield _unit(name, value, unit, looks)
    if 0.0 < strongest < _WEAKEST:
        yield _unit("F_n", strongest, "N", "kN")


def _is_numbered(smooth: Smoothed) -> bool:
    """Return whether the times are row numbers: 0, 1, 2, ..."""
    return bool((np.diff(smooth.t) == 1.0).all() and smooth.t[0] in (0.0, 1.0))


_NUMBERED = Doubt(
    "unit",
    "t counts the rows: 0, 1, 2, ...",
    "rows are conditions or means, not samples of a motion",
    "slips and lags cannot be seen in them",
)


def _unit(name: str, value: float, unit: str, looks: str) -> Doubt:
    return Doubt(
        "unit",
        f"{name} of {value:.3g} {unit}",
        f"these look like {looks}",
        f"--unit {name}={looks} if its table states none, else correct the table or "
        "its import",
    )


def _timing(trial: PreparedTrial) -> Iterator[Doubt]:
    if not trial.is_prepared and _is_swapped(trial):
        yield Doubt(
            "swapped",
            "F_t exceeds F_n while the foot rests",
            "the columns F_t and F_n are swapped",
            "--columns F_n=...,F_t=...",
        )
    if trial.lag is None:
        return
    late = (trial.lag.seconds - trial.stamped_lag) * 1e3
    if abs(late) > LATEST_MS:
        yield Doubt(
            "lag",
            f"the force is {abs(late):.0f} ms {'late' if late > 0 else 'early'} "
            f"against the motion (limit {LATEST_MS:g})",
            "a filter in the sensor, a queue or the latency of its port, or two clocks",
            f"--what-if lag={trial.lag.seconds * 1e3:.0f} shows what it changes",
        )


def _is_swapped(trial: PreparedTrial) -> bool:
    """Return whether F_t exceeds F_n before the foot first moves.

    At that time it stands under its weight and is not yet pushed.
    """
    smooth = trial.smooth
    end = standing_rows(smooth)
    if not end:
        return False
    load, along = float(np.median(smooth.F_n[:end])), float(np.median(smooth.F_t[:end]))
    return along > max(PRESSED, 2.0 * abs(load))


def standing_rows(smooth: Smoothed) -> int:
    """Count the rows before the foot first moves; 0 if it stands too briefly."""
    moving = np.flatnonzero(np.abs(smooth.v_t) > 2.0 * SLOWEST)
    end = int(moving[0]) if moving.size else 0
    return end if end >= 2 and smooth.t[end] - smooth.t[0] >= _REST else 0


def _normal(load: Array) -> Iterator[Doubt]:
    median = float(np.median(load))
    if median <= 0.0:
        yield Doubt(
            "normal",
            f"the ground pulls at the moving foot: median F_n {median:.1f} N",
            "the sensor's sign is wrong, or it was tared with the foot on the ground",
        )


def _signs(v: Array, load: Array, along: Array) -> Iterator[Doubt]:
    travel = float(v.sum()) / float(np.abs(v).sum())
    if travel < 0.0:
        yield Doubt(
            "direction",
            f"the foot moves backward over {0.5 - travel / 2:.0%} of its path",
            "the heading of the container is turned by 180 degrees",
            "traction calibrate terrain",
        )
    power = float(np.mean(along * v))
    if power < 0.0:
        mean = power / float(np.mean(np.abs(along * v)))
        yield Doubt("power", f"the ground drives the foot ({mean:+.0%})", _TURNED)
    ratio = float(np.median(along * np.sign(v) / np.abs(load)))
    if not along.any():
        yield Doubt(
            "no-traction",
            "F_t is 0 throughout",
            "the column was never filled, or is the wrong one",
            "--columns F_t=...",
        )
    elif ratio <= 0.0:
        yield Doubt("ratio", f"median F_t/F_n {ratio:.2f}", _TURNED)
    elif not FRICTION[0] <= ratio <= FRICTION[1]:
        yield Doubt(
            "friction",
            f"median F_t/F_n {ratio:.2g} is outside {FRICTION[0]:g} to {FRICTION[1]:g}",
            "F_t and F_n are swapped, or the tare or a calibration is wrong",
        )


def _frozen(recorded: RecordedTrial) -> Iterator[Doubt]:
    """Check each sensor channel between the foot's first and last motion."""
    moving = np.flatnonzero(np.abs(recorded.traction[:, 0]) > SLOWEST)
    if moving.size < FEWEST:
        return
    slid = slice(int(moving[0]), int(moving[-1]) + 1)
    taken_ns = recorded.cycles["ft_ns"][slid]
    is_new = np.concatenate([[True], taken_ns[1:] != taken_ns[:-1]])
    wrench = recorded.cycles["wrench_raw"][slid][is_new]
    channels = frozen_channels(recorded.t[slid][is_new], wrench)
    if channels:
        yield Doubt(
            "frozen",
            f"{', '.join(channel.text for channel in channels)} while the foot slides",
            "a broken gauge or wire, or a saturated channel; no force is reliable",
            "change the cable or the sensor, and record again",
        )


def _zero(recorded: RecordedTrial) -> Iterator[Doubt]:
    if recorded.bracket is not None:
        yield from zero_doubts(recorded.bracket.force_change)


def zero_doubts(change: float) -> Iterator[Doubt]:
    """Check the change of the sensor's zero between the tares around a trial [N]."""
    if change > LARGEST_CHANGE:
        yield Doubt(
            "zero",
            f"the sensor's zero moved by {change:.1f} N between the tares before and "
            f"after it (limit {LARGEST_CHANGE:g})",
            "the foot or the sensor came loose or was knocked, or a tare was touched",
            "look at the foot's mount, and record again",
        )


def _path(recorded: RecordedTrial, moving: NDArray[np.bool_]) -> Iterator[Doubt]:
    """Compare the path of the sole with the heading and incline of the container."""
    ahead, aside, above = (
        (recorded.sole[moving] - np.array(recorded.frame.start))
        @ recorded.frame.axes().T
    ).T
    if np.ptp(ahead) < SHORTEST:
        return
    turned, tilted = (
        float(np.degrees(np.arctan(np.polyfit(ahead, other, 1)[0])))
        for other in (aside, above)
    )
    sides: tuple[tuple[DoubtName, float, float, str], ...] = (
        ("heading", turned, HEADING, "the container is rotated, or its heading is"),
        ("incline", tilted, INCLINE, "the incline differs, or was"),
    )
    for name, angle, limit, what in sides:
        deviation = float(np.ptp(ahead)) * np.tan(np.radians(abs(angle)))
        if abs(angle) > limit and deviation > UNEVEN:
            yield Doubt(
                name,
                f"the sole's path is {angle:+z.1f} degrees off the container's "
                f"{name} (limit {limit:g})",
                f"{what} entered wrong",
                "traction calibrate terrain",
            )


def _sideways(lateral: Array, along: Array) -> Iterator[Doubt]:
    aside, forward = float(np.median(np.abs(lateral))), float(np.median(np.abs(along)))
    if aside > forward:
        yield Doubt(
            "lateral",
            f"{aside:.1f} N across the path, {forward:.1f} N along it",
            "the sensor is turned by 90 degrees about z, or the heading is wrong",
        )


def moment_doubts(force: Array, moment: Array) -> Iterator[Doubt]:
    """Check the moment along the force, which no point of action can produce.

    A force at a point has no moment along itself; the moment of a sliding sole about
    the normal is small compared with the force times the radius of the sole.
    """
    along = np.einsum("ni,ni->n", force, moment)
    pitch = float(np.median(np.abs(along) / np.einsum("ni,ni->n", force, force)))
    if pitch > FREE_MOMENT:
        yield Doubt(
            "moment",
            f"moment along the force {pitch * 1e3:.0f} mm times the force "
            f"(limit {FREE_MOMENT * 1e3:.0f})",
            "axes of the moment are swapped, or the calibration belongs to another "
            "sensor",
        )


def _pressure(recorded: RecordedTrial, wrench: Array) -> Iterator[Doubt]:
    """Check that the centre of pressure lies on the sole."""
    if recorded.sensor_height is None:
        return
    origin = np.array([0.0, 0.0, recorded.sensor_height])
    sole = recorded.payload.rotation.T @ (recorded.sole_point - origin)
    moment = wrench[:, 3:] - np.cross(sole, wrench[:, :3])
    pressed = np.abs(wrench[:, 2]) > PRESSED
    if np.count_nonzero(pressed) < FEWEST:
        return
    aside = moment[pressed, :2] / wrench[pressed, 2:3]
    distance = float(np.hypot(*np.median(aside, axis=0)))
    if distance > FARTHEST:
        yield Doubt(
            "pressure",
            f"the force acts {distance * 1e3:.0f} mm from the sole's centre "
            f"(limit {FARTHEST * 1e3:.0f})",
            "a moment of the sensor has the other sign, or another foot is mounted",
        )
