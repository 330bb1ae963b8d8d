"""Catalogue of faults and the reaction to each: recorded name, details, action.

`FAULTS` has one row per fault. The operator's texts have the same names in
`experiments/data/messages.toml`; tests compare the two.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import Enum, StrEnum
from typing import Any

from acquisition.control_loop.details import (
    CircuitCauses,
    ContactExcess,
    DoubledPuck,
    FaultDetail,
    FootSpeedExcess,
    ForceAge,
    ForceGrowth,
    ForeignFrame,
    FrozenEncoder,
    Joint7Slip,
    JointExcess,
    LateCycles,
    LateReplies,
    LoopGap,
    MotionExcess,
    NoDetail,
    ReplySilence,
    SafetySilence,
    Saturation,
    StalledMotor,
)
from acquisition.devices import MotorChange, PositionJump


class Action(Enum):
    """Reaction to a fault, in order of severity.

    END_TRIAL ends the trial and does not change the arm's state; the console then
    requests hold.
    """

    NONE = "none"
    END_TRIAL = "end-trial"
    HOLD = "hold"
    DAMP = "damp"
    IDLE = "idle"


_SEVERITY = {action: severity for severity, action in enumerate(Action)}


class Fault(StrEnum):
    """Reason for a reaction of the guard; the value is its recorded name."""

    E_STOP = "estop"
    PENDANT_IDLE = "pendant-idle"
    CAN_SILENCE = "can-silence"
    REPLIES_LATE = "replies-late"
    SAFETY_SILENT = "safety-silent"
    POSITION_JUMP = "position-jump"
    MOTOR_STALLED = "motor-stuck"
    ENCODER_FROZEN = "motor-still"
    BUS_SHARED = "bus-shared"
    PUCK_CHANGED = "puck-changed"
    PUCK_DISOBEYS = "puck-disobeys"
    PUCK_DOUBLED = "puck-doubled"
    UNREQUESTED_ACTIVE = "not-asked-active"
    NOT_ACTIVE = "arm-not-active"
    ACTIVATION_MOTION = "activation-motion"
    HOLD_MOTION = "hold-motion"
    DAMP_MOTION = "damp-motion"
    POWERED_TEST_MOTION = "proof-motion"
    KINETIC_ENERGY = "kinetic-energy"
    NOT_A_NUMBER = "not-a-number"
    JOINT_LIMIT = "joint-limit"
    OVERSPEED = "overspeed"
    FOOT_SPEED = "foot-speed"
    TORQUE_LIMIT = "torque-limit"
    JOINT7_SLIP = "joint7-slip"
    FT_STALE = "ft-stale"
    FT_SATURATED = "ft-saturated"
    CONTACT_FORCE = "contact-force"
    CONTACT_MOMENT = "contact-moment"
    CONTACT_GROWTH = "contact-growth"
    CONTACT_MOVE = "contact-move"
    LOOP_LATE = "loop-late"
    LOOP_LOST = "loop-lost"
    MOVE_REFUSED = "move-refused"
    CONSOLE_SILENT = "console-silent"
    CONSOLE_LOST = "console-lost"
    RECORDER_SILENT = "recorder-silent"


@dataclass(frozen=True, slots=True)
class FaultSpec:
    """Properties of a fault.

    Attributes:
        actions: reaction; a second one applies if the fault lasts or exceeds a second
            limit.
        detail: type of its details.
        ends_session: no trial can follow; the arm has to be activated again.
    """

    actions: tuple[Action, ...]
    detail: type[FaultDetail] = NoDetail
    ends_session: bool = False


_HOLD, _DAMP, _IDLE = (Action.HOLD,), (Action.DAMP,), (Action.IDLE,)
_END_TRIAL = (Action.END_TRIAL,)
FAULTS: Mapping[Fault, FaultSpec] = {
    Fault.E_STOP: FaultSpec(_IDLE, CircuitCauses, ends_session=True),
    Fault.PENDANT_IDLE: FaultSpec(_IDLE, CircuitCauses, ends_session=True),
    Fault.CAN_SILENCE: FaultSpec(
        (Action.HOLD, Action.IDLE), ReplySilence, ends_session=True
    ),
    Fault.REPLIES_LATE: FaultSpec(
        (Action.HOLD, Action.IDLE), LateReplies, ends_session=True
    ),
    Fault.SAFETY_SILENT: FaultSpec(
        (Action.HOLD, Action.IDLE), SafetySilence, ends_session=True
    ),
    Fault.POSITION_JUMP: FaultSpec(
        (Action.HOLD, Action.IDLE), PositionJump, ends_session=True
    ),
    Fault.MOTOR_STALLED: FaultSpec(_IDLE, StalledMotor, ends_session=True),
    Fault.ENCODER_FROZEN: FaultSpec(_IDLE, FrozenEncoder, ends_session=True),
    Fault.BUS_SHARED: FaultSpec(_IDLE, ForeignFrame, ends_session=True),
    Fault.PUCK_CHANGED: FaultSpec(_IDLE, MotorChange, ends_session=True),
    Fault.PUCK_DISOBEYS: FaultSpec(_IDLE, MotorChange, ends_session=True),
    Fault.PUCK_DOUBLED: FaultSpec(_IDLE, DoubledPuck, ends_session=True),
    Fault.UNREQUESTED_ACTIVE: FaultSpec(_IDLE, ends_session=True),
    Fault.NOT_ACTIVE: FaultSpec(_IDLE, ends_session=True),
    Fault.ACTIVATION_MOTION: FaultSpec(_IDLE, MotionExcess, ends_session=True),
    Fault.HOLD_MOTION: FaultSpec(_IDLE, MotionExcess, ends_session=True),
    Fault.DAMP_MOTION: FaultSpec(_IDLE, MotionExcess, ends_session=True),
    Fault.POWERED_TEST_MOTION: FaultSpec(_IDLE, MotionExcess, ends_session=True),
    Fault.KINETIC_ENERGY: FaultSpec(_IDLE, MotionExcess, ends_session=True),
    Fault.NOT_A_NUMBER: FaultSpec(_IDLE, ends_session=True),
    Fault.JOINT_LIMIT: FaultSpec(_DAMP, JointExcess),
    Fault.OVERSPEED: FaultSpec(_DAMP, JointExcess),
    Fault.FOOT_SPEED: FaultSpec(_DAMP, FootSpeedExcess),
    Fault.TORQUE_LIMIT: FaultSpec(_DAMP, JointExcess),
    Fault.JOINT7_SLIP: FaultSpec(_HOLD, Joint7Slip),
    Fault.FT_STALE: FaultSpec(_HOLD, ForceAge),
    Fault.FT_SATURATED: FaultSpec(_END_TRIAL, Saturation),
    Fault.CONTACT_FORCE: FaultSpec((Action.END_TRIAL, Action.HOLD), ContactExcess),
    Fault.CONTACT_MOMENT: FaultSpec((Action.END_TRIAL, Action.HOLD), ContactExcess),
    Fault.CONTACT_GROWTH: FaultSpec(_END_TRIAL, ForceGrowth),
    Fault.CONTACT_MOVE: FaultSpec(_HOLD, ContactExcess),
    Fault.LOOP_LATE: FaultSpec(_HOLD, LateCycles),
    Fault.LOOP_LOST: FaultSpec(_IDLE, LoopGap, ends_session=True),
    Fault.MOVE_REFUSED: FaultSpec(_HOLD),
    Fault.CONSOLE_SILENT: FaultSpec(_HOLD),
    Fault.CONSOLE_LOST: FaultSpec(_HOLD),
    Fault.RECORDER_SILENT: FaultSpec(_HOLD),
}
_NO_DETAIL = NoDetail()


@dataclass(frozen=True, slots=True)
class GuardVerdict:
    """Decision of the guard.

    Attributes:
        action: reaction from this cycle on.
        fault: reason, or None.
        detail: details of the fault, of the type in `FAULTS`.
    """

    action: Action
    fault: Fault | None = None
    detail: FaultDetail = _NO_DETAIL

    @property
    def severity(self) -> int:
        """Severity of the action: 0 none, 1 end of trial, 2 hold, 3 damp, 4 idle."""
        return _SEVERITY[self.action]

    @property
    def strictness(self) -> tuple[bool, int]:
        """Sort key of simultaneous verdicts: those that end the session rank higher."""
        return self.ends_session, self.severity

    @property
    def reason(self) -> str:
        """Recorded name of the fault; "" for none."""
        return "" if self.fault is None else self.fault.value

    @property
    def ends_session(self) -> bool:
        """Whether no trial can follow."""
        return self.fault is not None and FAULTS[self.fault].ends_session


OK = GuardVerdict(Action.NONE)


def verdict_for(
    fault: Fault, detail: FaultDetail = _NO_DETAIL, *, is_lasting: bool = False
) -> GuardVerdict:
    """Return the verdict of a fault with its action from the catalogue."""
    action = FAULTS[fault].actions[-1 if is_lasting else 0]
    return GuardVerdict(action, fault, detail)


def to_plain(verdict: GuardVerdict) -> list[Any]:
    """Convert a verdict to JSON values."""
    return [verdict.action.value, verdict.reason, asdict(verdict.detail)]


def from_plain(plain: list[Any]) -> GuardVerdict:
    """Convert JSON values of `to_plain` back to a verdict."""
    action, reason, values = plain
    if not reason:
        return GuardVerdict(Action(action))
    fault = Fault(reason)
    if FAULTS[fault].detail is CircuitCauses:  # JSON has no tuples
        return GuardVerdict(
            Action(action), fault, CircuitCauses(tuple(values["causes"]))
        )
    return GuardVerdict(Action(action), fault, FAULTS[fault].detail(**values))
