"""The expected outcome of each fault in each phase, as data."""

from dataclasses import dataclass, replace
from enum import Enum

from acquisition.control_loop.states import ArmState
from tests.faults.phases import PHASES

HOLD, DAMP = ArmState.HOLD, ArmState.DAMP


DAMPED_OR_IDLE = "damped or idle"


class End(Enum):
    """How the command ends."""

    COMPLETE = "nothing happens"
    REFUSED = "refused, nothing created"
    NOT_ACTIVATED = "not activated, resumed"
    REPORTED = "reported, the trial continues or is redone"
    REDONE = "trial interrupted and redone"
    UNTARED = "five tares refused, resumed"
    UNBRACKETED = "kept, the last tare is missing"
    ENDED = "session ends, resumed"
    SOMEHOW = "stopped; the session continues or ends"
    UNMEASURED = "the arm stops, nothing is written"
    UNSTARTED = "nothing is created"
    UNWRITTEN = "session ends, data on the disk are kept"
    STOPPED = "left unfinished by a signal, resumed"
    INTERRUPTED = "ends at once"
    KILLED = "ends; the arm is idle without it, resumed"
    LOST_EARLY = "ends, nothing recorded"
    ABSENT = "-"


@dataclass(frozen=True, slots=True)
class Arm:
    """The reaction of the arm and the longest time from the fault to it.

    Attributes:
        limit_ms: the time limit of the fault; 20 ms are added to it.
        seen: the state by the pucks: "driven", "last torques", "idle", "without
            power", or DAMPED_OR_IDLE in any state of the loop.
        state: of the loop; None = any.
        text: the words of the message about the arm.
    """

    limit_ms: float
    seen: str
    state: ArmState | None
    text: str


@dataclass(frozen=True, slots=True)
class Cell:
    """The expected outcome of one fault in one phase.

    Attributes:
        end: how the command ends.
        text: part of the message.
        rejected: reasons for the rejected attempts.
        arm: immediate reaction of the arm; None = no reaction.
        at_rest: final state of the arm as seen by the pucks.
        why: reason why the cell cannot exist, or a remark.
        then: part of a second message, where one fault causes another.
    """

    end: End
    text: str = ""
    rejected: tuple[str, ...] = ()
    arm: Arm | None = None
    at_rest: str = "idle"
    why: str = ""
    then: str = ""


Row = tuple[Cell, ...]
OK = Cell(End.COMPLETE)
NO_LOOP = Cell(End.ABSENT, why="the control loop is not running yet")
UNSEEN = Cell(
    End.COMPLETE,
    why="not detected while the sole is at rest; motors 2 to 6 end a trial after 60 mm",
)
OTHER_REFUSED = Cell(End.COMPLETE, why="the second command is refused (arm-busy)")
AT_REVIEW = ("session ended at the review",)


def _row(cell: Cell, **others: Cell) -> Row:
    """Return a row with `cell` in every phase except those of `others`."""
    assert set(others) <= set(PHASES)
    return tuple(others.get(phase, cell) for phase in PHASES)


def _refused(text: str) -> Cell:
    return Cell(End.REFUSED, text)


def _ending(text: str, arm: Arm, why: str, **others: Cell) -> Row:
    """Return the row of a fault that stops the arm and ends the session."""
    ended = Cell(End.ENDED, text, arm=arm)
    ended = replace(ended, at_rest=arm.seen if arm.seen == NO_POWER else "idle")
    phases = {
        "recording": replace(ended, rejected=(f"interrupted: {why}",)),
        "review": replace(ended, rejected=AT_REVIEW),
        "end": replace(OK, at_rest=ended.at_rest),
    }
    return _row(ended, **{**phases, **others})


NO_POWER = "without power"
_SILENT = Arm(10, "last torques", HOLD, "held by its last torques")
_UNKNOWN = Arm(10, "last torques", HOLD, "UNKNOWN - support it")
_IDLE = Arm(5, "idle", ArmState.IDLE, "idle")
_BEAT = replace(_IDLE, limit_ms=100)
_STOPPED = Arm(2, NO_POWER, ArmState.IDLE, "stopped by its hardware")
_HELD = Arm(20, "driven", HOLD, "holding")
_DAMPED = Arm(4, "driven", DAMP, "damped where it is")
_PUCK = "Puck 3 has not answered for "
_MODULE = "The safety module put the arm to idle: "


def _not_ready(text: str) -> Cell:
    return Cell(End.NOT_ACTIVATED, text)


_UNPOWERED = replace(
    _not_ready("The arm is in E-stop: its pucks have no power."), at_rest=NO_POWER
)
_IN_STOP = replace(
    _refused("The arm is in E-stop: its pucks have no power."), at_rest=NO_POWER
)


def _module(word: str, idle: Cell) -> Row:
    """Return the row of a fault that a monitor of the safety module reports at once."""
    text = f"{_MODULE}{word} fault."
    resent = replace(OK, why="the module's limits are written again at start")
    return _ending(text, _IDLE, "pendant-idle", preflight=resent, idle=idle)


def _sensor(limit_ms: float, waits: str, preflight: Cell, **others: Cell) -> Row:
    """Return the row of a wrist sensor without valid readings."""
    held = replace(_HELD, limit_ms=limit_ms)
    redone = Cell(End.REDONE, "T01 stopped at", ("interrupted: ft-stale",), held)
    waiting = Cell(End.REPORTED, waits)
    phases = {
        "preflight": preflight,
        "ready": replace(redone, arm=None, why="stopped as soon as recording begins"),
        "recording": redone,
        "review": replace(waiting, why="the trial is complete; the last tare waits"),
    }
    return _row(waiting, **{**phases, **others})


def _lost_sensor(waits: str, preflight: Cell) -> Row:
    """Return the row of a sensor that must be reopened."""
    untared = Cell(End.UNTARED, waits)
    cut = replace(untared, rejected=("interrupted: ft-stale",))
    kept = Cell(End.UNBRACKETED, waits)
    held = Arm(20, "driven", HOLD, "holding")
    return _row(
        untared,
        preflight=preflight,
        ready=cut,
        recording=replace(cut, arm=held),
        review=kept,
        end=kept,
    )


def _limit(text: str, why: str, **others: Cell) -> Row:
    """Return the row of a violated motion limit of the guard."""
    warned = Cell(End.REPORTED, text, arm=_DAMPED)
    phases = {
        "preflight": NO_LOOP,
        "idle": Cell(End.ENDED, text, why="detected when the arm becomes active"),
        "recording": replace(warned, end=End.REDONE, rejected=(f"interrupted: {why}",)),
        "end": OK,
    }
    return _row(warned, **{**phases, **others})


def _creeping(motor: int) -> Row:
    """Return the row of an encoder that drifts until a limit stops the arm.

    Joint 7 turns the foot about its own axis, so only its stop or its lock reveals it.
    """
    arm = Arm(1700 if motor == 7 else 400, DAMPED_OR_IDLE, None, "")
    stopped = Cell(End.SOMEHOW, arm=arm)
    late = Cell(End.SOMEHOW, why="detected when the arm becomes active")
    then = "Damping does not slow the arm down: the sole's speed" if motor == 7 else ""
    return _row(stopped, preflight=late, idle=late, end=replace(OK, arm=arm, then=then))


_BEGUN = replace(
    OK,
    why="only the energy is checked in the first 0.15 s of a hold; a wrist has little",
)


def _lying(motor: int) -> Row:
    """Return the row of an encoder that jumps by a step that the driver accepts."""
    if motor == 4:  # joint 4 turns too little to be detected
        return _row(OK)
    stopped = Cell(
        End.ENDED,
        "The arm does not stay in place while it holds: ",
        arm=_IDLE,
        why="the step is taken for motion, and the arm is idled",
    )
    if motor in {5, 6}:
        return _row(OK, tare=stopped, review=_BEGUN)
    return _row(OK, tare=stopped, review=replace(stopped, rejected=AT_REVIEW))


def _disk(word: str) -> Row:
    text = f"cannot be written ({word})"
    lost = Cell(End.UNWRITTEN, text)
    crashed = replace(lost, rejected=("the session ended without closing",))
    unstarted = Cell(End.UNSTARTED, f"{text}. Name another folder with --data.")
    return _row(lost, recording=crashed, preflight=unstarted)


_NO_DATA = _refused("No F/T data for 100 ms")
_NO_FRAME = _refused("No whole F/T frame")
_FEW = "are too few for a tare"
_FLAGGED = "F/T samples were flagged during tare"
_ASKED = "Joint 7 would need "
_STAYS = replace(OK, why="the arm is idle and remains idle")
_PUSHED_AWAY = Cell(
    End.ENDED,
    "The arm does not stay in place while it holds",
    arm=Arm(10, "idle", ArmState.IDLE, "idle"),
    why="the arm is already in hold and is pushed away",
)
_BRAKED = Cell(End.ABSENT, why="joint 7 is damped like the other joints")
_SLIP = Cell(
    End.REDONE,
    "Joint 7 moved",
    ("interrupted: joint7-slip",),
    Arm(100, "driven", HOLD, "holding"),
)
_SLIP_LATER = replace(
    _SLIP,
    arm=None,
    why="checked in trials, stops the next one; a released foot swings back",
    then=" rad/s (limit 4.00)",
)
# After a fault that ends a trial, the console requests hold 20 ms later.
_BEYOND = Cell(
    End.REDONE,
    "the F/T sensor was out of range for ",
    ("interrupted: ft-saturated",),
    Arm(120, "driven", HOLD, "holding"),
)
_LOADED = Cell(
    End.REDONE,
    " N on the foot (limit 100)",
    ("interrupted: contact-force",),
    Arm(30, "driven", HOLD, "holding"),
)
_PAST = " answered an earlier request: positions are "
# One cycle in 47 has no request; late positions are then confirmed within 20 ms.
_OLD = Arm(120, "idle", ArmState.IDLE, "UNKNOWN, held with old positions")
_UNCONFIRMED = replace(OK, why="the session ends before a cycle without a request")


def _late() -> Row:
    """Return the row of positions that are always late by whole cycles."""
    return _ending(
        _PAST,
        _OLD,
        "replies-late",
        preflight=_refused(" not report a position in time: "),
        end=_UNCONFIRMED,
    )


def _wrong_property(name: str, puck: int) -> Row:
    """Return the row of a puck with a wrong property from the start."""
    later = Cell(End.ABSENT, why="read at every start; a later change is puck-changed")
    return _row(later, preflight=_refused(f"{name} of puck {puck} is "))


_REVERSED = Cell(End.SOMEHOW, why="detected only by motion of the arm")
_DEAD = Cell(
    End.SOMEHOW,
    why="not detected while a person holding the arm supports the load of the motor; "
    "otherwise the arm is idled as it sinks",
)
_NOT_REWIRED = Cell(End.ABSENT, why="cables are not changed while the arm is driven")
_ASKED_IN_TURN = replace(
    OK, why="one property is read every 0.1 s, so that all of them take 3.5 s"
)
_LET_GO = replace(OK, why="the arm holds, or rests on the ground with its virtual mass")
_DRAGGED = replace(OK, why="the person yields at the next prompt, within 0.2 m")
_WEAK = Cell(
    End.SOMEHOW,
    arm=Arm(30, DAMPED_OR_IDLE, None, ""),
    why="limited torque damps weakly: the arm is idled if it keeps moving",
)
_NOT_HELD = Cell(End.ABSENT, why="an idle arm does not hold")
_NEVER_SEEN_ACTIVE = Cell(
    End.NOT_ACTIVATED,
    "The arm was not activated within 120 s.",
    why="the module reports IDLE permanently, and the arm is held",
)
_SHARED = "Another program sends to the arm: frame "
_TWICE = "Puck 3 sends more replies than there are requests"
_EARLY = "The arm was activated before the screen asked for it."
_NAN = "A position or torque was not a number."
_CANNOT_COUNT = Cell(End.ENDED, "Joint torques are not numbers")
_HEARTBEAT = f"{_MODULE}heartbeat fault."

_EARLY_ANEW = _not_ready("The arm was not activated within 120 s.")
_DISOBEYS = "does not follow its commands"
# The modes and torques of all pucks are requested within 0.12 s.
_CAUGHT = replace(_IDLE, limit_ms=130)
_SET_ANEW = replace(OK, why="activation sets the mode of every puck")


def _disobeying(later: Cell) -> Row:
    """Return the row of a puck that ignores commands.

    `later`: the outcome of the fault if the arm is not yet active.
    """
    why = "puck-disobeys"
    return _ending(_DISOBEYS, _CAUGHT, why, preflight=later, idle=later)


_JUMPED = Cell(
    End.ENDED,
    "The position of motor 7 jumped by ",
    arm=replace(_SILENT, seen="driven", text="UNKNOWN - support it"),
    why="its position changes, too",
)
_UNSEEN_RESTART = replace(
    OK,
    why="not detected while the arm is idle; on the real arm a restarted puck sleeps",
)
_NO_TORQUES = Cell(End.ENDED, _DISOBEYS, why="detected when the arm becomes active")
_MISSED = _ending(
    "The pendant or the safety module put the arm to idle",
    replace(_IDLE, limit_ms=20),
    "pendant-idle",
    preflight=_NO_TORQUES,
    idle=_NO_TORQUES,
)

NOTHING = "nothing"  # reference for the other rows

TABLE: dict[str, Row] = {
    NOTHING: _row(OK),
    "reply-lost": _row(OK),
    "reply-lost-3": _row(OK),
    "reply-lost-10": _ending(
        _PUCK,
        _SILENT,
        "can-silence",
        preflight=replace(OK, why="the driver waits for the first positions"),
        idle=replace(OK, why="over before torques are prepared"),
    ),
    "reply-lost-some": _row(OK),
    "reply-late": _row(OK),
    "reply-doubled": _row(OK),
    "reply-swapped": _row(OK),
    "reply-spoilt": _row(
        OK,
        # A wrong first position is the reference of the correct ones for a while.
        preflight=_refused(" of 100 exchanges with the arm were incomplete."),
    ),
    "puck-silent": _ending(
        _PUCK,
        _SILENT,
        "can-silence",
        preflight=_refused("Puck 3 does not answer (1,2,4,5,6,7 do)."),
        idle=_not_ready("Puck 3 has not answered for 100 ms."),
    ),
    "puck-reboot": _ending(
        _PUCK,
        _SILENT,
        "can-silence",
        preflight=_refused("The arm is not zeroed."),
        idle=_not_ready("Puck 3 has not answered for 100 ms."),
    ),
    "puck-hot": _row(OK),
    "puck-error": _row(OK),
    "can-silence": _ending(
        "No reply from the arm for ",
        _UNKNOWN,
        "can-silence",
        preflight=_refused("Pucks 1,2,3,4,5,6,7 do not answer"),
        idle=_not_ready("Pucks 1,2,3,4,5,6,7 have not answered for 100 ms."),
    ),
    "bus-off": _ending(
        "The CAN controller has left the bus after too many errors (bus-off); no reply",
        _UNKNOWN,
        "can-silence",
        preflight=_refused("The CAN controller has left the bus"),
        idle=_not_ready("The CAN controller has left the bus (bus-off)."),
    ),
    "interface-down": _ending(
        "The CAN interface refuses to send and receive; no reply",
        _UNKNOWN,
        "can-silence",
        preflight=_refused("CAN fake bus failed"),
        idle=_not_ready("The CAN interface refuses to send and receive."),
    ),
    "unacknowledged": _ending(
        "No device on the CAN bus acknowledges; no reply",
        _UNKNOWN,
        "can-silence",
        preflight=_refused("No device on the CAN bus acknowledges."),
        idle=_not_ready("No device on the CAN bus acknowledges"),
    ),
    "bus-flooded": _row(OK),
    "bus-shared": _ending(
        _SHARED,
        _IDLE,
        "bus-shared",
        preflight=Cell(End.ENDED, _SHARED, why="detected as soon as the loop runs"),
        idle=Cell(End.ENDED, _SHARED),
    ),
    "puck-doubled": _ending(
        _TWICE,
        replace(_IDLE, limit_ms=20),
        "puck-doubled",
        preflight=_refused(_TWICE),
        idle=Cell(End.ENDED, _TWICE),
    ),
    "early-activation": _row(
        replace(OK, why="the arm is already active"),
        preflight=replace(
            _not_ready("The arm was not activated within 120 s."),
            why="no positions requested yet: the module idles the arm and reports why",
        ),
        idle=Cell(End.ENDED, _EARLY, arm=replace(_IDLE, limit_ms=10)),
    ),
    "replies-late": _late(),
    "replies-late-2": _late(),
    "replies-late-3": _late(),
    "puck-late": _late(),
    "suspended-1-s": _ending(
        "The control loop missed every deadline for 998 ms",
        replace(_IDLE, limit_ms=1000),
        "loop-lost",
        preflight=_EARLY_ANEW,
        idle=_EARLY_ANEW,
    ),
    **{f"mode-lost-{puck}": _disobeying(_SET_ANEW) for puck in (2, 4, 7)},
    "torques-lost": _disobeying(_NO_TORQUES),
    "torques-lost-wrist": _disobeying(_NO_TORQUES),
    **{f"deaf-puck-{puck}": _MISSED for puck in range(1, 8)},
    "puck-restart": _row(
        Cell(End.ENDED, _DISOBEYS, arm=_CAUGHT),
        preflight=_UNSEEN_RESTART,
        idle=_UNSEEN_RESTART,
        recording=replace(_JUMPED, rejected=("interrupted: position-jump",)),
        review=replace(_JUMPED, rejected=AT_REVIEW),
        end=OK,
    ),
    "puck-changed": _row(_ASKED_IN_TURN, preflight=_refused("IPNM of puck 3 is ")),
    "wrong-pidx": _wrong_property("PIDX", 3),
    "wrong-mt": _wrong_property("MT", 2),
    "wrong-grp": _wrong_property("GRPB", 3),
    "wrong-ipnm": _wrong_property("IPNM", 7),
    "wrong-cts": _wrong_property("CTS", 4),
    **{f"dead-motor-{motor}": _row(_DEAD) for motor in range(1, 8)},
    **{
        f"reversed-motor-{motor}": _row(
            _NOT_REWIRED, preflight=_REVERSED, idle=_REVERSED
        )
        for motor in range(1, 8)
    },
    "hand-gone": _row(_LET_GO),
    "hold-dragged": _row(_DRAGGED, preflight=_NOT_HELD, idle=_NOT_HELD),
    "estop": _ending(
        "Stop pressed", _STOPPED, "estop", preflight=_IN_STOP, idle=_UNPOWERED
    ),
    "pendant-idle": _ending(
        "The pendant or the safety module put the arm to idle",
        _IDLE,
        "pendant-idle",
        preflight=replace(OK, why="the arm is already idle"),
        idle=replace(OK, why="the arm is already idle"),
    ),
    "safety-heartbeat": _ending(
        _HEARTBEAT,
        _BEAT,
        "pendant-idle",
        preflight=Cell(
            End.ENDED, _HEARTBEAT, why="detected when the arm becomes active"
        ),
        idle=Cell(End.ENDED, _HEARTBEAT, why="detected when the arm becomes active"),
    ),
    "safety-speed": _module("velocity", Cell(End.ENDED, f"{_MODULE}velocity fault.")),
    "safety-torque": _module(
        "torque",
        replace(
            _not_ready("The arm was not activated within 120 s."),
            why="the module refuses to become active",
        ),
    ),
    "safety-voltage": _ending(
        "The safety module stopped the arm: voltage fault.",
        _STOPPED,
        "estop",
        preflight=_IN_STOP,
        idle=_UNPOWERED,
    ),
    "position-jump": _ending(
        "The position of motor 3 jumped by ",
        replace(_SILENT, seen="driven", text="UNKNOWN - support it"),
        "position-jump",
        preflight=Cell(
            End.ABSENT, why="positions are checked against the preceding ones"
        ),
        idle=_not_ready("Puck 3 has not answered for 100 ms."),
    ),
    "safety-silent": _ending(
        "The safety module has not reported its mode for ",
        Arm(250, "driven", HOLD, "UNKNOWN - support it"),
        "safety-silent",
        preflight=_refused("The safety module does not answer"),
        ready=Cell(
            End.ENDED,
            "The safety module has not reported its mode for ",
            ("interrupted: safety-silent",),
            Arm(250, "driven", HOLD, "UNKNOWN - support it"),
            why="the trial begins before the fault is detected",
        ),
        idle=Cell(
            End.ENDED,
            "The safety module has not reported its mode for ",
            why="detected when torques are prepared",
        ),
    ),
    "safety-disobedient": _row(OK),
    "safety-false-idle": _ending(
        "The pendant or the safety module put the arm to idle",
        Arm(60, "last torques", ArmState.UNKNOWN, "UNKNOWN - support it"),
        "pendant-idle",
        preflight=_NEVER_SEEN_ACTIVE,
        idle=_NEVER_SEEN_ACTIVE,
    ),
    **{f"lie-of-motor-{motor}": _lying(motor) for motor in range(1, 7)},
    # The lock pushes joint 7 back with almost its maximum torque.
    "lie-of-motor-7": _row(
        OK,
        recording=Cell(End.REDONE, _ASKED, ("interrupted: torque-limit",), _DAMPED),
        review=Cell(End.REPORTED, _ASKED, arm=_DAMPED),
    ),
    **{f"stuck-motor-{motor}": _row(UNSEEN) for motor in range(1, 8)},
    **{f"creep-of-motor-{motor}": _creeping(motor) for motor in range(1, 8)},
    "ft-stale": _sensor(20, _FEW, _NO_DATA),
    "ft-frozen": _sensor(70, _FLAGGED, Cell(End.REPORTED, _FLAGGED)),
    # One channel of six: within two spans of 0.25 s, and 20 ms without a valid sample.
    "ft-stuck": _sensor(
        520,
        _FLAGGED,
        Cell(End.REPORTED, _FLAGGED),
        recording=Cell(
            End.REPORTED,
            _FLAGGED,
            why="the trial ends first; its review names the channel",
        ),
    ),
    "ft-garbled": _sensor(20, _FEW, _NO_FRAME),
    "ft-saturated": _sensor(
        0,
        _FLAGGED,
        Cell(End.REPORTED, _FLAGGED),
        ready=replace(_BEYOND, arm=None, why="stopped as soon as recording begins"),
        recording=_BEYOND,
    ),
    "contact-force": _row(
        Cell(End.REPORTED, "Known-pose residual"),
        tare=Cell(End.REPORTED, "Force varied "),
        ready=replace(_LOADED, arm=None, why="stopped as soon as recording begins"),
        recording=_LOADED,
    ),
    "ft-not-a-number": _sensor(
        20, _FLAGGED, _refused("The F/T sensor sends raw gauge data or absurd forces")
    ),
    "ft-unplugged": _lost_sensor(_FEW, _NO_DATA),
    "ft-jump": _row(
        Cell(End.REPORTED, "Known-pose residual"),
        tare=Cell(End.REPORTED, "Force varied "),
    ),
    "ft-reboot": _lost_sensor(_FLAGGED, replace(OK, why="the sensor is set up again")),
    "ft-clock-jump": _lost_sensor(
        _FLAGGED, replace(OK, why="the clock fit begins afterwards")
    ),
    "not-a-number": _ending(
        _NAN,
        Arm(2, "idle", ArmState.IDLE, "idle"),
        "not-a-number",
        preflight=NO_LOOP,
        idle=_CANNOT_COUNT,
    ),
    "joint-limit": _limit("Joint 6 at ", "joint-limit"),
    "torque-limit": _limit(
        "Joint 2 would need ",
        "torque-limit",
        idle=Cell(
            End.ENDED,
            "Joint 2 would need ",
            why="detected when the arm becomes active; without torque it sinks",
            then="Damping does not slow the arm down: kinetic energy",
        ),
        **dict.fromkeys(("ready", "recording", "review"), _WEAK),
    ),
    "foot-speed": _limit(
        "The foot moved at ",
        "foot-speed",
        idle=Cell(
            End.REPORTED, "The foot moved at ", why="detected when the arm is moved"
        ),
        tare=replace(
            _WEAK, why="a disturbance that may exceed the limits of hold, too"
        ),
    ),
    "overspeed": _limit(
        "Joint 6 ", "overspeed", preflight=_STAYS, idle=_STAYS, tare=_PUSHED_AWAY
    ),
    "joint7-slip": _row(
        OK,
        preflight=_BRAKED,
        idle=_BRAKED,
        tare=_SLIP_LATER,
        ready=_SLIP_LATER,
        recording=_SLIP,
        review=replace(OK, why="checked in trials only"),
    ),
    "stall-3-ms": _row(OK),
    "stall-20-ms": _row(
        OK,
        recording=Cell(
            End.REDONE,
            "T01 stopped at",
            ("interrupted: ft-stale",),
            replace(_HELD, limit_ms=20),
            why="no force was checked meanwhile",
        ),
    ),
    "stall-150-ms": _row(
        Cell(End.ENDED, _HEARTBEAT, arm=replace(_IDLE, limit_ms=150)),
        preflight=replace(OK, why="the arm is idle"),
        idle=replace(OK, why="the arm is idle"),
        recording=Cell(
            End.ENDED,
            _HEARTBEAT,
            ("interrupted: ft-stale",),
            replace(_IDLE, limit_ms=150),
        ),
        review=Cell(End.ENDED, _HEARTBEAT, AT_REVIEW, replace(_IDLE, limit_ms=150)),
        end=OK,
    ),
    "stall-150-ms, heartbeat 1 s": _row(
        OK,
        recording=Cell(
            End.REDONE,
            "T01 stopped at",
            ("interrupted: ft-stale",),
            replace(_HELD, limit_ms=150),
            why="no force was checked meanwhile",
        ),
    ),
    "can-silence, heartbeat 1 s": _ending(
        "No reply from the arm for ",
        _UNKNOWN,
        "can-silence",
        preflight=_refused("Pucks 1,2,3,4,5,6,7 do not answer"),
        idle=_not_ready("Pucks 1,2,3,4,5,6,7 have not answered for 100 ms."),
    ),
    "clock-step": _row(OK),
    "second-command": _row(OTHER_REFUSED),
    "disk-full": _disk("No space left on device"),
    "disk-read-only": _disk("Read-only file system"),
}


def cells() -> list[tuple[str, str, Cell]]:
    """Return (fault, phase, outcome) of every possible cell."""
    return [
        (fault, phase, cell)
        for fault, row in TABLE.items()
        for phase, cell in zip(PHASES, row, strict=True)
        if cell.end is not End.ABSENT
    ]
