"""Part of the dry friction of the drives taken off the hand that leads the arm.

One bristle per motor follows the counts of its encoder, in the form that Hayward,
Armstrong, Altpeter and Dupont (2009) give for measured positions alone. With dq the
step of a cycle and z in shares of the deflection z_o at which it slides,

    z <- clip(z + dq / z_o (1 - alpha |z|), -1, 1),    tau = c F_low z

alpha is 0 where the step unbends the bristle. No velocity enters, so there is neither a
filter's lag nor its noise, and an arm at rest is pushed as far as it went. The torque
never exceeds what surely rubs, or the arm would move by itself: F_low is the lower end
of what a calibration found for that sense of motion, at the worst place of a turn.
"""

from dataclasses import dataclass

import numpy as np

from acquisition.devices import ArmReading
from wam.model.constants import ArmConstants, Array
from wam.model.friction import ELASTIC, MotorFriction, motor_turns, plastic_share

LARGEST_SHARE = 0.8
SWUNG_MOTOR = "friction:swung_motor"  # in the recording
_MARGIN = 0.9  # of what surely rubs: share (1 + error) never exceeds it
_SIGMAS = 1.96
# Four times what is assumed of real bristles: a stiffer one would hunt.
_PRESLIDING = np.array([4.0, 4.0, 4.0, 4.0, 8.0, 8.0, 8.0]) * 1e-3  # rad of the joint
_FADE_NS = 100_000_000  # ns, when the arm is let go of or held
_AT_WALL = 0.02  # rad, in which it fades before a stop
# A motor whose bristle is bent the other way so often within a second swings.
_SWINGS, _SWING_NS = 12, 1_000_000_000
_BENT = 0.7


@dataclass(frozen=True, slots=True)
class KnownFriction:
    """Dry friction of the motors that surely is there.

    Attributes:
        forward: of motion in the positive sense [N m], shape (7,), 0 or more.
        backward: of motion in the negative sense [N m], shape (7,), 0 or more.
        error: relative uncertainty of the Coulomb torques, shape (7,).
        load: what is lost per N m that a motor bears less than `load_at`, shape (7,).
        load_at: torques at which the others hold [N m], shape (7,).
    """

    forward: Array
    backward: Array
    error: Array
    load: Array
    load_at: Array


def known_friction(
    friction: MotorFriction, deviation: Array, asymmetry_deviation: Array
) -> KnownFriction:
    """Return the lower end of an identified friction, 95 %.

    At the smallest place of its ripple.

    Args:
        friction: as identified.
        deviation: of its Coulomb torques [N m], shape (7,).
        asymmetry_deviation: of its asymmetries [N m], shape (7,).
    """
    doubt = _SIGMAS * np.hypot(deviation, asymmetry_deviation)
    least = 1.0 - np.hypot(friction.ripple_sin, friction.ripple_cos)
    level = friction.coulomb - doubt
    return KnownFriction(
        forward=np.maximum((level + friction.asymmetry) * least, 0.0),
        backward=np.maximum((level - friction.asymmetry) * least, 0.0),
        error=_SIGMAS * deviation / friction.coulomb,
        load=np.maximum(friction.load, 0.0) * least,
        load_at=friction.load_at,
    )


class FrictionCompensation:
    """Torques of the bristles of seven motors, in float only.

    Attributes:
        swung_motor: the first motor that swung to and fro as no hand does, 1-7; 0 =
            none. Its friction is not what was calibrated: nothing is compensated since.
    """

    def __init__(
        self, constants: ArmConstants, known: KnownFriction, share: float
    ) -> None:
        """Compensate `share` of what is known, motor by motor.

        Raises:
            ValueError: `share` is outside 0..0.8.
        """
        if not 0.0 <= share <= LARGEST_SHARE:
            raise ValueError(f"share {share} is outside 0..{LARGEST_SHARE}")
        shares = np.minimum(share, _MARGIN / (1.0 + known.error))
        reach = (
            motor_turns(constants)
            * _PRESLIDING
            * np.array(constants.cts)
            / (2.0 * np.pi)
        )
        levels = shares * known.forward, shares * known.backward
        rows = np.stack((1.0 / reach, *levels, shares * known.load, known.load_at))
        self.swung_motor = 0
        self._j2mp = np.array(constants.j2mp)
        self._to_joints = np.ascontiguousarray(self._j2mp.T)
        self._of_torques = np.linalg.inv(self._to_joints)
        self._rows: list[list[float]] = rows.T.tolist()
        self._load_torques = [0.0] * 7
        self._fading = np.zeros(7)
        self._rested_ns = -_FADE_NS
        self._begin([])

    def metadata(self) -> dict[str, str]:
        """Return for the recording which motor ended the compensation, "0" = none."""
        return {SWUNG_MOTOR: str(self.swung_motor)}

    def rest(self, now_ns: int) -> None:
        """Stop compensating; what is pushed fades within a tenth of a second."""
        if self._counts:
            self._fading = self._push()
            self._rested_ns = now_ns
            self._begin([])

    def resting(self, now_ns: int) -> Array | None:
        """Return what is left of the torques since `rest` [N m], (7,); None = 0."""
        share = 1.0 - (now_ns - self._rested_ns) / _FADE_NS
        return self._fading * share if share > 0.0 else None

    def torque(
        self, reading: ArmReading, load_torque: Array, depth: Array | None = None
    ) -> Array:
        """Return joint torques [N m], shape (7,), after the step of this cycle.

        Args:
            reading: of this cycle; a motor that did not answer goes no step.
            load_torque: torques of the joints without compensation [N m], shape (7,).
            depth: how far each joint is inside its soft wall [rad], shape (7,); None =
                no joint is.
        """
        now = reading.host_ns
        if self.swung_motor == 0:
            self._follow(reading.counts)
            self._watch(now)
        if self.swung_motor:
            self.rest(now)
            fading = self.resting(now)
            return np.zeros(7) if fading is None else fading
        self._load_torques = self._of_torques.dot(load_torque).tolist()
        return self._push(depth)

    def _begin(self, counts: list[int]) -> None:
        self._counts = counts
        self._z = [0.0] * 7
        self._bent = [0] * 7  # which way each bristle was bent last
        self._turned: list[list[int]] = [[] for _ in range(7)]  # when it went over [ns]

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
        """Notice a motor whose bristle goes from one end to the other and back."""
        for motor, z in enumerate(self._z):
            way = 1 if z > _BENT else -1 if z < -_BENT else 0
            if way == 0 or way == self._bent[motor]:
                continue
            self._bent[motor] = way
            turned = [*self._turned[motor], now_ns][-_SWINGS:]
            self._turned[motor] = turned
            if len(turned) == _SWINGS and now_ns - turned[0] < _SWING_NS:
                self.swung_motor = motor + 1
                return

    def _push(self, depth: Array | None = None) -> Array:
        # Plain numbers: seven of them are done before numpy has looked at an array.
        push: list[float] = []
        state = zip(self._z, self._load_torques, self._rows, strict=True)
        for z, load_torque, (_, forward, backward, load, load_at) in state:
            level = forward if z > 0.0 else backward
            if load and (less := load_at - abs(load_torque)) > 0.0:
                level = max(level - load * less, 0.0)
            push.append(z * level)
        tau = np.array(push)
        if depth is not None:
            # Both motors of a differential let go where either of its joints stops.
            free = 1.0 - np.minimum(np.abs(depth) / _AT_WALL, 1.0)
            tau *= np.where(self._j2mp != 0.0, free, 1.0).min(axis=1)
        return self._to_joints.dot(tau)
