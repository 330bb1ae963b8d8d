"""Columns of the tables of a trial: unit, meaning and resolution.

A number is written to a tenth of its instrument's resolution: finer digits are noise.
"""

from collections.abc import Callable

import numpy as np

from acquisition.devices import SafetyMode
from acquisition.sample import MOTOR_FRESH_SHIFT, Flag
from analysis.data.load import RecordedTrial
from analysis.data.prepare import (
    MINIMUM_KEPT,
    MINIMUM_TRAVEL_SHARE,
    PreparedTrial,
    PrepareOptions,
)
from experiments.export.table_columns import Quantity, Values

_JOINTS = tuple(str(joint) for joint in range(1, 8))
_AXES = ("x", "y", "z")
_BASE, _TERRAIN, _LOOP = "arm's base", "terrain", "loop"
_SAFETY_MODE = 0b111  # bits of the flags
# Resolutions: one count of an instrument, or its noise in one sample.
_CLOCK = 1e-5  # s: jitter of the start of a cycle
_ANGLE = 3.6e-5  # rad: 4096 counts a turn of the motor, geared 42 to 1
_JOINT_SPEED = 1.6e-4  # rad/s: a tenth of a count in 22 ms, the width of the average
_TORQUE = 8.5e-4  # N m: a count of motor 7's current, 14.93 / 17474
_FORCE = 4e-3  # N: 1/256 N, a count of the finest gauges that are supported
_MOMENT = 2.5e-4  # N m: 1/4096 N m, likewise
_POSITION = 3.6e-5  # m: a count of a joint at a reach of 1 m
_SPEED = 1.6e-4  # m/s: as of the joints; the slowest kept velocity is 5e-3
_Recorded = Callable[[RecordedTrial], Values]


TrialQuantity = Quantity[RecordedTrial]
KeptQuantity = Quantity[PreparedTrial]


def kept_rule(options: PrepareOptions) -> str:
    """Describe the rule for kept samples."""
    return (
        f"centred moving average of {options.smoothing} samples at 500 Hz "
        f"({2 * options.smoothing} ms), then one sample of {options.downsample} "
        f"({2 * options.downsample} ms), then those with "
        f"{options.slowest:g} <= v_t <= {options.fastest:g} m/s; a trial counts with "
        f"{MINIMUM_KEPT} kept samples and {MINIMUM_TRAVEL_SHARE:.0%} of the container "
        "crossed"
    )


def _cycle(field: str) -> _Recorded:
    return lambda trial: trial.cycles[field]


def _traction(column: int) -> _Recorded:
    return lambda trial: trial.traction[:, column]


def _raw(columns: slice) -> _Recorded:
    return lambda trial: trial.cycles["wrench_raw"][:, columns]


def _flag(flag: Flag) -> _Recorded:
    return lambda trial: trial.cycles["flags"] & flag != 0


def _fresh_motors(trial: RecordedTrial) -> Values:
    bits = 1 << (MOTOR_FRESH_SHIFT + np.arange(7))
    return trial.cycles["flags"][:, None] & bits != 0


def _safety_modes(trial: RecordedTrial) -> Values:
    words = np.array([_mode_word(code) for code in range(_SAFETY_MODE + 1)])
    return words[trial.cycles["flags"] & _SAFETY_MODE]


def _mode_word(code: int) -> str:
    names = {mode.value: mode.name.lower().replace("_", "-") for mode in SafetyMode}
    return names.get(code, names[SafetyMode.UNKNOWN])


SAFETY_MODES = tuple(dict.fromkeys(map(_mode_word, range(_SAFETY_MODE + 1))))


def _of_joints(prefix: str) -> tuple[str, ...]:
    return tuple(prefix + joint for joint in _JOINTS)


def _of_axes(prefix: str) -> tuple[str, ...]:
    return tuple(prefix + axis for axis in _AXES)


def _number(
    names: tuple[str, ...] | str,
    where: tuple[str, str],
    meaning: str,
    values: _Recorded,
    resolution: float,
) -> TrialQuantity:
    """Return a measured quantity; `where` is (unit, frame)."""
    names = (names,) if isinstance(names, str) else names
    return Quantity(names, *where, meaning, values, resolution, "number")


_FLAGS = (
    ("arm_fresh", "all joints answered in this cycle", Flag.ARM_FRESH),
    ("ft_fresh", "a new sample of the sensor was used", Flag.FT_FRESH),
    ("ft_saturated", "the sensor reports saturation", Flag.FT_SATURATED),
    ("torque_clipped", "a torque was limited", Flag.TORQUE_CLIPPED),
    ("safety_warning", "the safety circuit reports a warning", Flag.SAFETY_WARNING),
    ("safety_fault", "the safety circuit reports a fault", Flag.SAFETY_FAULT),
    ("deadline_missed", "the cycle began after its deadline", Flag.DEADLINE_MISSED),
    ("joint7_locked", "the lock of joint 7 is on", Flag.JOINT7_LOCKED),
    ("contact", "the foot is on the ground", Flag.CONTACT),
    ("simulated", "the devices are simulated", Flag.SIMULATED),
    ("bus_error", "the bus controller reported an error", Flag.BUS_ERROR),
    ("arm_unasked", "no position was asked for, on purpose", Flag.ARM_UNASKED),
)
QUANTITIES: tuple[TrialQuantity, ...] = (
    _number("t", ("s", "host clock"), "since the first cycle", lambda x: x.t, _CLOCK),
    Quantity(("cycle",), "1", _LOOP, "number of the cycle", _cycle("cycle")),
    Quantity(
        ("safety_mode",),
        "",
        "safety circuit",
        f"of the arm: {', '.join(SAFETY_MODES)}",
        _safety_modes,
        kind="string",
    ),
    *(
        Quantity((name,), "1", _LOOP, meaning, _flag(flag), kind="boolean")
        for name, meaning, flag in _FLAGS
    ),
    Quantity(
        _of_joints("motor_fresh"),
        "1",
        "motors 1..7",
        "the motor's reply arrived in this cycle",
        _fresh_motors,
        kind="boolean",
    ),
    _number(
        _of_joints("q"), ("rad", "joints 1..7"), "position", _cycle("position"), _ANGLE
    ),
    _number(
        _of_joints("qd"),
        ("rad/s", "joints 1..7"),
        "velocity, as the controller used it",
        _cycle("velocity"),
        _JOINT_SPEED,
    ),
    _number(
        _of_joints("tau"),
        ("N m", "joints 1..7"),
        "torque, as sent",
        _cycle("torque_command"),
        _TORQUE,
    ),
    _number(
        _of_axes("raw_f"), ("N", "sensor"), "force as read", _raw(slice(0, 3)), _FORCE
    ),
    _number(
        _of_axes("raw_t"),
        ("N m", "sensor"),
        "torque as read, not tared",
        _raw(slice(3, 6)),
        _MOMENT,
    ),
    _number(
        _of_axes("sole_"),
        ("m", _BASE),
        "centre of the sole",
        lambda x: x.sole,
        _POSITION,
    ),
    _number(
        _of_axes("v_"),
        ("m/s", _BASE),
        "velocity of the sole; NaN beside gaps",
        lambda x: x.velocity,
        _SPEED,
    ),
    _number(
        _of_axes("F_"),
        ("N", _BASE),
        "force of the ground on the foot",
        lambda x: x.force,
        _FORCE,
    ),
    _number(
        "travelled",
        ("m", _TERRAIN),
        "distance of the sole from the far end",
        lambda x: x.displacement,
        _POSITION,
    ),
    Quantity(
        ("v_t",),
        "m/s",
        _TERRAIN,
        "slip velocity, > 0 in ordinary slip",
        _traction(0),
        _SPEED,
        "number",
        more_digits=2,  # keeps a sample at an edge of the window on its side
    ),
    _number(
        "F_t",
        ("N", _TERRAIN),
        "traction force, > 0 against ordinary slip",
        _traction(1),
        _FORCE,
    ),
    _number(
        "F_n",
        ("N", _TERRAIN),
        "normal force, > 0 in compression",
        _traction(2),
        _FORCE,
    ),
)


def _kept(name: str, values: Callable[[PreparedTrial], Values]) -> KeptQuantity:
    """Return a column of the kept samples: that of the trial, smoothed."""
    (quantity,) = (q for q in QUANTITIES if q.names == (name,))
    meaning = quantity.meaning if name == "t" else f"{quantity.meaning}; smoothed"
    return Quantity(
        quantity.names,
        quantity.unit,
        quantity.frame,
        meaning,
        values,
        quantity.resolution,
        quantity.kind,
    )


# Samples that models are fitted to: smoothed, thinned, inside the velocity window.
KEPT: tuple[KeptQuantity, ...] = (
    _kept("t", lambda x: x.smooth.t[x.indices]),
    _kept("v_t", lambda x: x.v_t),
    _kept("F_n", lambda x: x.F_n),
    _kept("F_t", lambda x: x.F_t),
    Quantity(
        ("kept_row",),
        "1",
        _TERRAIN,
        "row of the trial's table, from 0",
        lambda x: x.indices,
    ),
    Quantity(
        ("simulated",),
        "1",
        _LOOP,
        "the devices are simulated",
        lambda x: np.full(x.kept, x.is_simulated),
        kind="boolean",
    ),
)
