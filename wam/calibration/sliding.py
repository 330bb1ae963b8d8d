"""Friction torque of each motor while it slides and breaks away, from recorded legs."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acquisition.clock import PERIOD_NS
from acquisition.errors import SettingsError
from wam.model.arm_model import ArmModel
from wam.model.constants import Array
from wam.model.friction import ELASTIC, largest_motor_ratios
from wam.model.moments import regressor

HALF = 10  # samples on each side of a centred line fit: 42 ms in all
# Joint 7 accelerates faster and breaks away within 20 ms: HALF would smooth it out.
_QUICK_MOTOR, _QUICK_HALF = 6, 4
_QUICK_SPAN = 60  # samples evaluated before break-away
_SLOW = 0.02  # rad/s; break-away is evaluated on legs up to this speed
_PERIOD = PERIOD_NS * 1e-9  # s
_STRIDE = 10  # samples from one row to the next
_SLOWEST = 2e-3  # rad/s of the joint; slower motion is not sliding
# rad of the joint after a reversal until the bristle deflection is that of sliding
_WINDING = np.array([6e-3] * 4 + [10e-3] * 3)
_BREAKING = np.array([3e-3] * 4 + [5e-3] * 3)  # rad of travel that is a break-away
_FEWEST_BENT, _BENT_SPAN = 20, 0.4  # samples, and share of the torque they span
FEWEST = 60  # rows of a motor, in each sense a quarter of them
BLOCK = 2.0  # s; residuals of rows within a block may be correlated


@dataclass(frozen=True, slots=True)
class RecordedLeg:
    """Recording of one leg, one row per cycle.

    Attributes:
        q: joint positions [rad], shape (n, 7).
        tau: joint torques as sent [N m], shape (n, 7).
        speed: commanded speed of the fastest joint [rad/s].
    """

    q: NDArray[np.float64]
    tau: NDArray[np.float64]
    speed: float


@dataclass(frozen=True, slots=True)
class SlidingRows:
    """Friction data of one motor; motor-side arrays of shape (n,) unless stated.

    Attributes:
        angle: [rad].
        speed: [rad/s]; 0 in break-away rows.
        sense: sense of motion, +1 or -1.
        load: gravity torque [N m].
        friction: motor torque less gravity and inertia [N m].
        inertia: inertial torque of the model [N m].
        gravity: torque per first moment of 1 kg m, shape (n, 21).
        block: number of the 2 s block, for correlated residuals.
        compliance: presliding compliance before break-away [rad/(N m)], one value per
            slow leg on which it is measurable, shape (m,).
    """

    angle: Array
    speed: Array
    sense: Array
    load: Array
    friction: Array
    inertia: Array
    gravity: Array
    block: NDArray[np.int64]
    compliance: Array = field(default_factory=lambda: np.empty(0))

    def __len__(self) -> int:
        return len(self.angle)


@dataclass(frozen=True, slots=True)
class _Motion:
    """A smoothed leg at the motors, shapes (n, 7)."""

    angle: Array
    speed: Array
    load: Array
    friction: Array
    inertia: Array
    q: Array


def sliding_rows(
    model: ArmModel, weighed: ArmModel, legs: Sequence[RecordedLeg]
) -> list[SlidingRows]:
    """Return the friction data of the seven motors on `legs`.

    Args:
        model: the arm with its tool.
        weighed: the arm with calibrated gravity.
        legs: recordings in order of time.
    """
    parts: list[list[SlidingRows]] = [[] for _ in range(7)]
    first = 0
    for leg in legs:
        if len(leg.q) < 6 * HALF:
            continue
        motion = _motion(model, weighed, leg)
        for motor in range(7):
            parts[motor].append(_motor_rows(model, weighed, motion, motor, leg, first))
        first += 1 + int(len(leg.q) * _PERIOD / BLOCK)
    return [_concatenated(part) for part in parts]


def check_row_count(motor: int, rows: SlidingRows) -> None:
    """Refuse the data of a motor with too few rows in total or in either sense.

    Raises:
        SettingsError: too few rows.
    """
    fewer = min(int((rows.sense > 0.0).sum()), int((rows.sense < 0.0).sum()))
    if len(rows) >= FEWEST and fewer >= FEWEST // 4:
        return
    raise SettingsError(
        f"Motor {motor} slid in {len(rows)} rows, {fewer} of them in the rarer sense "
        f"(at least {FEWEST} and {FEWEST // 4}).",
        hint="Does the motor turn as it is sent? Clear more space around the arm.",
    )


def _motion(model: ArmModel, weighed: ArmModel, leg: RecordedLeg) -> _Motion:
    """Return the smoothed leg at the motors; all signals share one filter."""
    j2mp = model.constants.j2mp
    to_motors = np.linalg.inv(j2mp)
    q, qd = _smooth(leg.q)
    tau, _ = _smooth(leg.tau)
    qdd = _smooth(qd)[1]
    rows = _row_indices(len(q))
    inertial, weights = np.zeros_like(q), np.zeros_like(q)
    for i in rows:
        inertial[i] = model.mass_matrix(q[i]) @ qdd[i] + model.coriolis(q[i], qd[i])
        weights[i] = weighed.gravity(q[i])
    # The dynamics are evaluated at every 10th sample and interpolated linearly.
    for joint in range(7):
        for table in (inertial, weights):
            table[:, joint] = np.interp(np.arange(len(q)), rows, table[rows, joint])
    return _Motion(
        angle=q @ j2mp.T,
        speed=qd @ j2mp.T,
        load=weights @ to_motors,
        friction=(tau - inertial - weights) @ to_motors,
        inertia=inertial @ to_motors,
        q=q,
    )


def _row_indices(count: int) -> NDArray[np.int64]:
    return np.arange(2 * HALF, count - 2 * HALF, _STRIDE)


def _smooth(values: Array, half: int = HALF) -> tuple[Array, Array]:
    """Return value and slope [1/s] of centred line fits, shapes as `values` (n, 7)."""
    steps = np.arange(-half, half + 1)
    mean = np.full(2 * half + 1, 1.0 / (2 * half + 1))
    slope = steps / (float(steps @ steps) * _PERIOD)
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    level = [np.convolve(column, mean, "valid") for column in padded.T]
    rate = [np.correlate(column, slope, "valid") for column in padded.T]
    return np.stack(level, axis=-1), np.stack(rate, axis=-1)


def _motor_rows(
    model: ArmModel,
    weighed: ArmModel,
    motion: _Motion,
    motor: int,
    leg: RecordedLeg,
    first: int,
) -> SlidingRows:
    """Return the rows of one motor on one leg; block numbers begin at `first`."""
    ratio = float(largest_motor_ratios(model.constants)[motor])
    angle, speed = motion.angle[:, motor], motion.speed[:, motor]
    rows = _row_indices(len(angle))
    rows = rows[_is_sliding(angle, speed, rows, ratio, float(_WINDING[motor]))]
    row_speed = speed[rows]
    sense = np.where(row_speed < 0.0, -1.0, 1.0)
    friction = motion.friction[rows, motor]
    compliance = np.empty(0)
    if leg.speed <= _SLOW:
        friction_before = motion.friction[:, motor]
        if motor == _QUICK_MOTOR:
            friction_before = _quick_friction(model, weighed, leg, motor, ratio)
        breakaway = _break_away(motion.angle[:, motor], friction_before, motor, ratio)
        if breakaway is not None:
            index, break_sense = breakaway
            rows = np.append(rows, index)
            row_speed, sense = np.append(row_speed, 0.0), np.append(sense, break_sense)
            friction = np.append(friction, friction_before[index])
            if motor != _QUICK_MOTOR:
                compliance = _compliance(
                    break_sense * angle[:index], break_sense * friction_before[:index]
                )
    to_motors = np.linalg.inv(model.constants.j2mp)[:, motor]
    gravity = [to_motors @ regressor(model.constants, motion.q[i]) for i in rows]
    return SlidingRows(
        angle=angle[rows],
        speed=row_speed,
        sense=sense,
        load=motion.load[rows, motor],
        friction=friction,
        inertia=motion.inertia[rows, motor],
        gravity=np.array(gravity).reshape(-1, 21),
        block=first + (rows * _PERIOD / BLOCK).astype(np.int64),
        compliance=compliance,
    )


def _is_sliding(
    angle: Array, speed: Array, rows: NDArray[np.int64], ratio: float, winding: float
) -> NDArray[np.bool_]:
    """Return at which of `rows` the motor is in steady sliding."""
    is_sliding = np.zeros(len(rows), dtype=bool)
    slowest, settled_travel = _SLOWEST * ratio, winding * ratio
    sense, reversal, k = 0.0, float(angle[0]), 0
    is_fast = np.abs(speed) > slowest
    for i in range(int(rows[-1]) + 1):
        current = float(np.sign(speed[i])) if is_fast[i] else 0.0
        if current not in {0.0, sense}:
            sense, reversal = current, float(angle[i])
        if i == rows[k]:
            is_settled = abs(float(angle[i]) - reversal) > settled_travel
            window = is_fast[i - HALF : i + HALF + 1]
            is_sliding[k] = current == sense and is_settled and bool(window.all())
            k += 1
    return is_sliding


def _breakaway_index(angle: Array, motor: int, ratio: float) -> int | None:
    """Return the sample of a motor's break-away; None if too early or none."""
    travel = np.abs(angle - angle[0])
    beyond = np.flatnonzero(travel > float(_BREAKING[motor]) * ratio)
    if not len(beyond) or beyond[0] <= 3 * HALF:
        return None
    return int(beyond[0])


def _break_away(
    angle: Array, friction: Array, motor: int, ratio: float
) -> tuple[int, float] | None:
    """Return (sample, sense) of the peak friction torque before break-away."""
    end = _breakaway_index(angle, motor, ratio)
    if end is None:
        return None
    sense = float(np.sign(angle[end] - angle[0]))
    resisting = sense * friction[2 * HALF : end]
    return 2 * HALF + int(resisting.argmax()), sense


def _compliance(angle: Array, friction: Array) -> Array:
    """Return the presliding compliance [rad/(N m)], shape (1,), or (0,) if unknown.

    Slope of angle over torque in the elastic range, below the share `ELASTIC` of the
    largest torque.

    Args:
        angle: in the sense of the motion, up to the largest torque [rad].
        friction: in that sense [N m].
    """
    start = 2 * HALF
    angle, friction = angle[start:], friction[start:]
    if len(friction) < _FEWEST_BENT:
        return np.empty(0)
    is_elastic = friction <= ELASTIC * friction[-1]
    count = int(is_elastic.sum())
    span = float(np.ptp(friction[is_elastic])) if count else 0.0
    if count < _FEWEST_BENT or span < _BENT_SPAN * float(friction[-1]):
        return np.empty(0)
    slope = np.polyfit(friction[is_elastic], angle[is_elastic], 1)[0]
    return np.array([slope]) if slope > 0.0 else np.empty(0)


def _quick_friction(
    model: ArmModel, weighed: ArmModel, leg: RecordedLeg, motor: int, ratio: float
) -> Array:
    """Return the friction torque before break-away, smoothed over 18 ms [N m], (n,).

    0 outside the `_QUICK_SPAN` samples before break-away.
    """
    friction = np.zeros(len(leg.q))
    end = _breakaway_index(leg.q @ model.constants.j2mp[motor], motor, ratio)
    if end is None:
        return friction
    to_motor = np.linalg.inv(model.constants.j2mp)[:, motor]
    q, qd = _smooth(leg.q, _QUICK_HALF)
    tau, qdd = _smooth(leg.tau, _QUICK_HALF)[0], _smooth(qd, _QUICK_HALF)[1]
    for i in range(max(end - _QUICK_SPAN, 0), end):
        inertial = model.mass_matrix(q[i]) @ qdd[i] + model.coriolis(q[i], qd[i])
        friction[i] = (tau[i] - inertial - weighed.gravity(q[i])) @ to_motor
    return friction


def _concatenated(parts: Sequence[SlidingRows]) -> SlidingRows:
    names = SlidingRows.__slots__
    columns = {n: np.concatenate([getattr(part, n) for part in parts]) for n in names}
    return SlidingRows(**columns)
