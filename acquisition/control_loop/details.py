"""Details of each kind of fault, as recorded and as used in its message."""

from dataclasses import dataclass

from acquisition.devices import MotorChange, PositionJump


@dataclass(frozen=True, slots=True)
class NoDetail:
    """A fault without details."""


_BUTTON = "other"  # monitor in fault while an E-stop button is pressed


@dataclass(frozen=True, slots=True)
class CircuitCauses:
    """Monitors of the safety circuit in fault after it stopped the arm."""

    causes: tuple[str, ...] = ()

    @property
    def tripped(self) -> tuple[str, ...]:
        """Monitors that stopped the arm; () = a person at the pendant."""
        return tuple(cause for cause in self.causes if cause != _BUTTON)


@dataclass(frozen=True, slots=True)
class ReplySilence:
    """Missing replies of the arm.

    Attributes:
        ms: time without complete replies [ms].
        silent: bit i set = motor i+1 did not answer in the last cycle.
    """

    ms: float
    silent: int


@dataclass(frozen=True, slots=True)
class LateReplies:
    """Stale positions: replies to an earlier request.

    Attributes:
        ms: least possible age [ms].
        motors: bit i set = reply of motor i+1 was stale.
    """

    ms: float
    motors: int


@dataclass(frozen=True, slots=True)
class DoubledPuck:
    """Motor, 1-7, with more position replies than requests."""

    motor: int


@dataclass(frozen=True, slots=True)
class SafetySilence:
    """Age of the safety module's last report [ms]."""

    ms: float


@dataclass(frozen=True, slots=True)
class StalledMotor:
    """Motor, 1-7, that a move drives without moving it."""

    motor: int


@dataclass(frozen=True, slots=True)
class FrozenEncoder:
    """A motor that does not turn in a trial.

    Attributes:
        motor: motor number, 1-7.
        mm: travel of the sole since the motor last turned [mm].
        limit: limit of that travel [mm].
    """

    motor: int
    mm: float
    limit: float


@dataclass(frozen=True, slots=True)
class ForeignFrame:
    """Identifier of a frame from another master on the arm's bus."""

    can_id: int


@dataclass(frozen=True, slots=True)
class MotionExcess:
    """Motion beyond that of a sound arm in its present state.

    Attributes:
        quantity: name of the quantity, for the message.
        value: measured value.
        limit: limit.
        unit: unit of both.
    """

    quantity: str
    value: float
    limit: float
    unit: str


@dataclass(frozen=True, slots=True)
class JointExcess:
    """A joint beyond its limit.

    Attributes:
        joint: joint number, 1-7.
        value: position [rad], or magnitude of speed [rad/s] or torque [N m].
        limit: of the same quantity.
    """

    joint: int
    value: float
    limit: float


@dataclass(frozen=True, slots=True)
class FootSpeedExcess:
    """Speed of the sole and its limit [m/s]."""

    value: float
    limit: float


@dataclass(frozen=True, slots=True)
class Joint7Slip:
    """Displacement of the locked joint 7 and its limit [mrad]."""

    mrad: float
    limit: float


@dataclass(frozen=True, slots=True)
class ForceAge:
    """Age of the newest force sample and its limit [ms]."""

    ms: float
    limit: float


@dataclass(frozen=True, slots=True)
class ContactExcess:
    """Force [N] or moment [N m] of the ground on the foot, and its limit."""

    value: float
    limit: float


@dataclass(frozen=True, slots=True)
class Saturation:
    """Time of the sensor beyond its range, and its limit [ms]."""

    ms: float
    limit: float


@dataclass(frozen=True, slots=True)
class ForceGrowth:
    """Growth of the force within 0.5 s, and its limit [N]."""

    value: float
    limit: float


@dataclass(frozen=True, slots=True)
class LoopGap:
    """Time without a punctual cycle of the loop, and its limit [ms]."""

    ms: float
    limit: float


@dataclass(frozen=True, slots=True)
class LateCycles:
    """Number of late cycles within a second, and its limit."""

    late: int
    limit: int


FaultDetail = (
    NoDetail
    | CircuitCauses
    | ReplySilence
    | LateReplies
    | LoopGap
    | MotorChange
    | SafetySilence
    | PositionJump
    | StalledMotor
    | FrozenEncoder
    | ForeignFrame
    | MotionExcess
    | JointExcess
    | FootSpeedExcess
    | Joint7Slip
    | ForceAge
    | ContactExcess
    | DoubledPuck
    | Saturation
    | ForceGrowth
    | LateCycles
)
