"""From recorded cycles to what resists each motor as it slides and breaks away."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acquisition.clock import PERIOD_NS
from acquisition.errors import SettingsError
from wam.model.arm_model import ArmModel
from wam.model.constants import Array
from wam.model.friction import ELASTIC, motor_turns
from wam.model.moments import regressor

HALF = 10  # samples on each side of the centre of a line fit: 42 ms in all
# Joint 7 turns at its own pace and breaks away within 20 ms, which HALF would flatten.
_QUICK_MOTOR, _QUICK_HALF = 6, 4
_QUICK_SPAN = 60  # samples before it has broken away
_SLOW = 0.02  # rad/s up to which a leg shows where motors break away
_PERIOD = PERIOD_NS * 1e-9  # s
_STRIDE = 10  # samples from one row to the next
_SLOWEST = 2e-3  # rad/s of the joint: below it nothing is called sliding
# rad of the joint from a reversal until the bristle is bent as by steady sliding
_WINDING = np.array([6e-3] * 4 + [10e-3] * 3)
_BREAKING = np.array([3e-3] * 4 + [5e-3] * 3)  # rad by which a motor has broken away
_FEWEST_BENT, _BENT_SPAN = 20, 0.4  # samples, and share of the torque they span
FEWEST = 60  # rows of a motor, in each sense a quarter of them
BLOCK = 2.0  # s of neighbouring rows whose residuals may be alike


@dataclass(frozen=True, slots=True)
class RecordedLeg:
    """One leg of the way, cycle by cycle.

    Attributes:
        q: joint positions [rad], shape (n, 7).
        tau: joint torques as sent [N m], shape (n, 7).
        speed: at which the quickest joint was sent [rad/s].
    """

    q: NDArray[np.float64]
    tau: NDArray[np.float64]
    speed: float


@dataclass(frozen=True, slots=True)
class SlidingRows:
    """What one motor showed; arrays of shape (n,) at the motor unless stated.

    Attributes:
        angle: [rad].
        speed: [rad/s]; 0 where it broke away.
        sense: of the motion, +1 or -1.
        load: torque that the weight puts on it [N m].
        friction: torque that neither weight nor inertia explains [N m].
        inertia: torque that accelerates the arm by its model [N m].
        gravity: torque by first moments of 1 kg m, shape (n, 21).
        block: number of the stretch of 2 s; residuals within one may be alike.
        compliance: how far the motor gave way before it broke away [rad/(N m)], one
            for each slow leg on which that shows, shape (m,).
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
    """Return what each of the seven motors showed on `legs`.

    Args:
        model: the arm with its tool.
        weighed: the arm as its gravity was calibrated.
        legs: recorded one after the other.
    """
    parts: list[list[SlidingRows]] = [[] for _ in range(7)]
    first = 0
    for leg in legs:
        if len(leg.q) < 6 * HALF:
            continue
        motion = _motion(model, weighed, leg)
        for motor in range(7):
            parts[motor].append(_of_motor(model, weighed, motion, motor, leg, first))
        first += 1 + int(len(leg.q) * _PERIOD / BLOCK)
    return [_joined(part) for part in parts]


def check_enough(motor: int, rows: SlidingRows) -> None:
    """Refuse rows in which a motor did not slide enough either way.

    Raises:
        SettingsError: it did not.
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
    """Return the leg with the same smoothing for everything in it."""
    j2mp = model.constants.j2mp
    to_motors = np.linalg.inv(j2mp)
    q, qd = _line(leg.q)
    tau, _ = _line(leg.tau)
    qdd = _line(qd)[1]
    rows = _every(len(q))
    inertial, weights = np.zeros_like(q), np.zeros_like(q)
    for i in rows:
        inertial[i] = model.mass_matrix(q[i]) @ qdd[i] + model.coriolis(q[i], qd[i])
        weights[i] = weighed.gravity(q[i])
    # Weight changes slowly: in between it is a straight line.
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


def _every(count: int) -> NDArray[np.int64]:
    return np.arange(2 * HALF, count - 2 * HALF, _STRIDE)


def _line(values: Array, half: int = HALF) -> tuple[Array, Array]:
    """Return value and slope [1/s] of centred line fits, shapes as `values` (n, 7)."""
    steps = np.arange(-half, half + 1)
    mean = np.full(2 * half + 1, 1.0 / (2 * half + 1))
    slope = steps / (float(steps @ steps) * _PERIOD)
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    level = [np.convolve(column, mean, "valid") for column in padded.T]
    rate = [np.correlate(column, slope, "valid") for column in padded.T]
    return np.stack(level, axis=-1), np.stack(rate, axis=-1)


def _of_motor(
    model: ArmModel,
    weighed: ArmModel,
    motion: _Motion,
    motor: int,
    leg: RecordedLeg,
    first: int,
) -> SlidingRows:
    """Return the rows of one motor on one leg; its blocks are counted from `first`."""
    turns = float(motor_turns(model.constants)[motor])
    angle, speed = motion.angle[:, motor], motion.speed[:, motor]
    rows = _every(len(angle))
    rows = rows[_is_sliding(angle, speed, rows, turns, float(_WINDING[motor]))]
    v = speed[rows]
    sense = np.where(v < 0.0, -1.0, 1.0)
    friction = motion.friction[rows, motor]
    given = np.empty(0)
    if leg.speed <= _SLOW:
        friction_before = motion.friction[:, motor]
        if motor == _QUICK_MOTOR:
            friction_before = _quick_friction(model, weighed, leg, motor, turns)
        broken = _break_away(motion.angle[:, motor], friction_before, motor, turns)
        if broken is not None:
            index, way = broken
            rows = np.append(rows, index)
            v, sense = np.append(v, 0.0), np.append(sense, way)
            friction = np.append(friction, friction_before[index])
            if motor != _QUICK_MOTOR:
                given = _compliance(way * angle[:index], way * friction_before[:index])
    to_motors = np.linalg.inv(model.constants.j2mp)[:, motor]
    weighing = [to_motors @ regressor(model.constants, motion.q[i]) for i in rows]
    return SlidingRows(
        angle=angle[rows],
        speed=v,
        sense=sense,
        load=motion.load[rows, motor],
        friction=friction,
        inertia=motion.inertia[rows, motor],
        gravity=np.array(weighing).reshape(-1, 21),
        block=first + (rows * _PERIOD / BLOCK).astype(np.int64),
        compliance=given,
    )


def _is_sliding(
    angle: Array, speed: Array, rows: NDArray[np.int64], turns: float, winding: float
) -> NDArray[np.bool_]:
    """Return at which of `rows` the motor has long slid one way."""
    is_sliding = np.zeros(len(rows), dtype=bool)
    slowest, far = _SLOWEST * turns, winding * turns
    way, turned_at, k = 0.0, float(angle[0]), 0
    fast = np.abs(speed) > slowest
    for i in range(int(rows[-1]) + 1):
        now = float(np.sign(speed[i])) if fast[i] else 0.0
        if now not in {0.0, way}:
            way, turned_at = now, float(angle[i])
        if i == rows[k]:
            is_far = abs(float(angle[i]) - turned_at) > far
            window = fast[i - HALF : i + HALF + 1]
            is_sliding[k] = now == way and is_far and bool(window.all())
            k += 1
    return is_sliding


def _broken_at(angle: Array, motor: int, turns: float) -> int | None:
    """Return the sample at which a motor has broken away; None = too soon or never."""
    moved = np.abs(angle - angle[0])
    beyond = np.flatnonzero(moved > float(_BREAKING[motor]) * turns)
    if not len(beyond) or beyond[0] <= 3 * HALF:
        return None
    return int(beyond[0])


def _break_away(
    angle: Array, friction: Array, motor: int, turns: float
) -> tuple[int, float] | None:
    """Return (sample, sense) where the motor resisted most before it turned."""
    end = _broken_at(angle, motor, turns)
    if end is None:
        return None
    way = float(np.sign(angle[end] - angle[0]))
    resisting = way * friction[2 * HALF : end]
    return 2 * HALF + int(resisting.argmax()), way


def _compliance(angle: Array, friction: Array) -> Array:
    """Return how far a motor gives way per torque before it breaks away, (0,) or (1,).

    A line through angle over torque where the bristle is elastic: below its plastic
    share of the largest torque.

    Args:
        angle: in the sense of the motion, up to the largest torque [rad].
        friction: in that sense [N m].
    """
    begun = 2 * HALF
    angle, friction = angle[begun:], friction[begun:]
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
    model: ArmModel, weighed: ArmModel, leg: RecordedLeg, motor: int, turns: float
) -> Array:
    """Return the friction of a motor before it breaks away, smoothed over 18 ms.

    0 where it is not asked for, shape (n,).
    """
    friction = np.zeros(len(leg.q))
    end = _broken_at(leg.q @ model.constants.j2mp[motor], motor, turns)
    if end is None:
        return friction
    to_motor = np.linalg.inv(model.constants.j2mp)[:, motor]
    q, qd = _line(leg.q, _QUICK_HALF)
    tau, qdd = _line(leg.tau, _QUICK_HALF)[0], _line(qd, _QUICK_HALF)[1]
    for i in range(max(end - _QUICK_SPAN, 0), end):
        inertial = model.mass_matrix(q[i]) @ qdd[i] + model.coriolis(q[i], qd[i])
        friction[i] = (tau[i] - inertial - weighed.gravity(q[i])) @ to_motor
    return friction


def _joined(parts: Sequence[SlidingRows]) -> SlidingRows:
    names = SlidingRows.__slots__
    columns = {n: np.concatenate([getattr(part, n) for part in parts]) for n in names}
    return SlidingRows(**columns)
