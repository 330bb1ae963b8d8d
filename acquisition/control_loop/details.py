"""The numbers of each kind of fault, as recorded and as put into its message."""

from dataclasses import dataclass

from acquisition.devices import MotorChange, PositionJump


@dataclass(frozen=True, slots=True)
class NoDetail:
    """A fault without numbers."""


_BUTTON = "other"  # the monitor that a pressed E-stop button shows


@dataclass(frozen=True, slots=True)
class CircuitCauses:
    """Monitors of the safety circuit that show a fault after it stopped the arm."""

    causes: tuple[str, ...] = ()

    @property
    def tripped(self) -> tuple[str, ...]:
        """Monitors that stopped the arm; () = a person did, at the pendant."""
        return tuple(cause for cause in self.causes if cause != _BUTTON)


@dataclass(frozen=True, slots=True)
class ReplySilence:
    """Silence of the arm.

    Attributes:
        ms: how long replies have been missing [ms].
        silent: bit i set = motor i+1 did not answer in the last cycle.
    """

    ms: float
    silent: int


@dataclass(frozen=True, slots=True)
class LateReplies:
    """Positions that answer an earlier question.

    Attributes:
        ms: their age, at least [ms].
        motors: bit i set = that of motor i+1 was late.
    """

    ms: float
    motors: int


@dataclass(frozen=True, slots=True)
class DoubledPuck:
    """Number of a motor, 1-7, whose position comes more often than it is asked for."""

    motor: int


@dataclass(frozen=True, slots=True)
class SafetySilence:
    """Age of the safety module's last answer [ms]."""

    ms: float


@dataclass(frozen=True, slots=True)
class StuckMotor:
    """Number of a motor, 1-7, that a move turns in vain."""

    motor: int


@dataclass(frozen=True, slots=True)
class StillMotor:
    """A motor that stands still in a trial.

    Attributes:
        motor: its number, 1-7.
        mm: how far the sole went meanwhile [mm].
        limit: how far it may go [mm].
    """

    motor: int
    mm: float
    limit: float


@dataclass(frozen=True, slots=True)
class ForeignFrame:
    """Identifier of a frame of another master on the arm's bus."""

    can_id: int


@dataclass(frozen=True, slots=True)
class MotionExcess:
    """Motion that no sound arm makes in what it is asked for.

    Attributes:
        quantity: what went beyond its limit, in words.
        value: of it.
        limit: of it.
        unit: of both.
    """

    quantity: str
    value: float
    limit: float
    unit: str


@dataclass(frozen=True, slots=True)
class JointExcess:
    """A joint beyond its limit.

    Attributes:
        joint: its number, 1-7.
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
    """How long the sensor has been beyond its range, and its limit [ms]."""

    ms: float
    limit: float


@dataclass(frozen=True, slots=True)
class ForceGrowth:
    """By how much the force grew within 0.5 s, and its limit [N]."""

    value: float
    limit: float


@dataclass(frozen=True, slots=True)
class LoopGap:
    """How long no cycle of the loop was in time, and the limit [ms]."""

    ms: float
    limit: float


@dataclass(frozen=True, slots=True)
class LateCycles:
    """Late cycles within a second, and how many are tolerated."""

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
    | StuckMotor
    | StillMotor
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
