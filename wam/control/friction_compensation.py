"""Partial compensation of the drives' dry friction while a person leads the arm.

One bristle per motor follows the encoder counts, in the position-only form of Hayward,
Armstrong, Altpeter and Dupont (2009). With dq the step of a cycle and z the deflection
as a share of z_o, at which the bristle slides,

    z <- clip(z + dq / z_o (1 - alpha |z|), -1, 1),    tau = c F_low z

alpha is 0 where the step reduces |z|. No velocity enters, hence no filter lag or noise;
at rest the torque keeps its value. To never move the arm by itself, the torque stays
below the true friction: F_low is the calibration's lower bound for that sense of motion
at the minimum of the ripple.
"""

from dataclasses import dataclass

import numpy as np

from acquisition.devices import ArmReading
from wam.model.constants import ArmConstants, Array
from wam.model.friction import (
    ELASTIC,
    MotorFriction,
    largest_motor_ratios,
    plastic_share,
)

LARGEST_SHARE = 0.8
OSCILLATING_MOTOR = "friction:swung_motor"  # metadata key of the recording
_MARGIN = 0.9  # of the true friction: upper bound of share (1 + error)
_SIGMAS = 1.96
# Four times the assumed presliding of the drives: a stiffer bristle would limit-cycle.
_PRESLIDING = np.array([4.0, 4.0, 4.0, 4.0, 8.0, 8.0, 8.0]) * 1e-3  # rad of the joint
_FADE_NS = 100_000_000  # after float has ended
_AT_WALL = 0.02  # rad of wall depth over which the compensation fades
# So many sign changes of the deflection within a second are an oscillation.
_SWINGS, _SWING_NS = 12, 1_000_000_000
_BENT = 0.7  # |z| that counts for a sign change


@dataclass(frozen=True, slots=True)
class FrictionLowerBound:
    """Lower bound of the motors' dry friction.

    Attributes:
        forward: in positive motion [N m], shape (7,), 0 or more.
        backward: in negative motion [N m], shape (7,), 0 or more.
        error: relative uncertainty of the Coulomb torques, shape (7,).
        load: decrease per N m of motor load below `load_at`, shape (7,).
        load_at: reference loads [N m], shape (7,).
    """

    forward: Array
    backward: Array
    error: Array
    load: Array
    load_at: Array


def friction_lower_bound(
    friction: MotorFriction, deviation: Array, asymmetry_deviation: Array
) -> FrictionLowerBound:
    """Return the lower 95 % bound of identified friction at the minimum of its ripple.

    Args:
        friction: identified friction.
        deviation: standard deviation of the Coulomb torques [N m], shape (7,).
        asymmetry_deviation: standard deviation of the asymmetries [N m], shape (7,).
    """
    margin = _SIGMAS * np.hypot(deviation, asymmetry_deviation)
    ripple_minimum = 1.0 - np.hypot(friction.ripple_sin, friction.ripple_cos)
    coulomb = friction.coulomb - margin
    return FrictionLowerBound(
        forward=np.maximum((coulomb + friction.asymmetry) * ripple_minimum, 0.0),
        backward=np.maximum((coulomb - friction.asymmetry) * ripple_minimum, 0.0),
        error=_SIGMAS * deviation / friction.coulomb,
        load=np.maximum(friction.load, 0.0) * ripple_minimum,
        load_at=friction.load_at,
    )


class FrictionCompensation:
    """Friction compensation of the seven motors, in float only.

    Attributes:
        oscillating_motor: first motor oscillating faster than a hand, 1-7; 0 = none.
            Its friction is below the calibrated one, so compensation has ended.
    """

    def __init__(
        self, constants: ArmConstants, known: FrictionLowerBound, share: float
    ) -> None:
        """Compensate `share` of the known friction of each motor.

        Raises:
            ValueError: `share` is outside 0..0.8.
        """
        if not 0.0 <= share <= LARGEST_SHARE:
            raise ValueError(f"share {share} is outside 0..{LARGEST_SHARE}")
        shares = np.minimum(share, _MARGIN / (1.0 + known.error))
        reach = (
            largest_motor_ratios(constants)
            * _PRESLIDING
            * np.array(constants.cts)
            / (2.0 * np.pi)
        )
        levels = shares * known.forward, shares * known.backward
        rows = np.stack((1.0 / reach, *levels, shares * known.load, known.load_at))
        self.oscillating_motor = 0
        self._j2mp = np.array(constants.j2mp)
        self._to_joints = np.ascontiguousarray(self._j2mp.T)
        self._of_torques = np.linalg.inv(self._to_joints)
        self._rows: list[list[float]] = rows.T.tolist()
        self._load_torques = [0.0] * 7
        self._fading = np.zeros(7)
        self._rested_ns = -_FADE_NS
        self._begin([])

    def metadata(self) -> dict[str, str]:
        """Return the oscillating motor as metadata of the recording, "0" = none."""
        return {OSCILLATING_MOTOR: str(self.oscillating_motor)}

    def stop(self, now_ns: int) -> None:
        """Stop compensating; the torque fades within 0.1 s."""
        if self._counts:
            self._fading = self._bristle_torque()
            self._rested_ns = now_ns
            self._begin([])

    def fading_torque(self, now_ns: int) -> Array | None:
        """Return the fading torques after `rest` [N m], (7,); None = all 0."""
        share = 1.0 - (now_ns - self._rested_ns) / _FADE_NS
        return self._fading * share if share > 0.0 else None

    def torque(
        self, reading: ArmReading, load_torque: Array, depth: Array | None = None
    ) -> Array:
        """Update the bristles and return joint torques [N m], shape (7,).

        Args:
            reading: reading of this cycle; the bristle of a silent motor is unchanged.
            load_torque: joint torques without compensation [N m], shape (7,).
            depth: depth of each joint in its soft wall [rad], shape (7,); None = all 0.
        """
        now = reading.host_ns
        if self.oscillating_motor == 0:
            self._follow(reading.counts)
            self._watch(now)
        if self.oscillating_motor:
            self.stop(now)
            fading = self.fading_torque(now)
            return np.zeros(7) if fading is None else fading
        self._load_torques = self._of_torques.dot(load_torque).tolist()
        return self._bristle_torque(depth)

    def _begin(self, counts: list[int]) -> None:
        self._counts = counts
        self._z = [0.0] * 7
        self._last_sign = [0] * 7  # sign of the last large deflection
        self._sign_changes_ns: list[list[int]] = [[] for _ in range(7)]

    def _follow(self, counts: list[int]) -> None:
        if not self._counts:
            self._begin(list(counts))
            return
        state = zip(counts, self._counts, self._z, self._rows, strict=True)
        for motor, (now, before, z, row) in enumerate(state):
            if now == before:
                continue
            step = (now - before) * row[0]
            if z * step > 0.0 and (bent := abs(z)) > ELASTIC:
                step *= 1.0 - plastic_share(bent) * bent
            self._z[motor] = min(max(z + step, -1.0), 1.0)
            self._counts[motor] = now

    def _watch(self, now_ns: int) -> None:
        """Detect a motor whose deflection oscillates between both ends."""
        for motor, z in enumerate(self._z):
            sign = 1 if z > _BENT else -1 if z < -_BENT else 0
            if sign == 0 or sign == self._last_sign[motor]:
                continue
            self._last_sign[motor] = sign
            changes = [*self._sign_changes_ns[motor], now_ns][-_SWINGS:]
            self._sign_changes_ns[motor] = changes
            if len(changes) == _SWINGS and now_ns - changes[0] < _SWING_NS:
                self.oscillating_motor = motor + 1
                return

    def _bristle_torque(self, depth: Array | None = None) -> Array:
        # Python floats: for seven values the loop is faster than numpy calls.
        torques: list[float] = []
        state = zip(self._z, self._load_torques, self._rows, strict=True)
        for z, load_torque, (_, forward, backward, load, load_at) in state:
            level = forward if z > 0.0 else backward
            if load and (unload := load_at - abs(load_torque)) > 0.0:
                level = max(level - load * unload, 0.0)
            torques.append(z * level)
        tau = np.array(torques)
        if depth is not None:
            # Both motors of a differential fade if either of its joints is at a wall.
            free = 1.0 - np.minimum(np.abs(depth) / _AT_WALL, 1.0)
            tau *= np.where(self._j2mp != 0.0, free, 1.0).min(axis=1)
        return self._to_joints.dot(tau)
