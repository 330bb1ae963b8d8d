"""The expected outcome of each fault during a calibration move of the arm."""

from dataclasses import replace

from acquisition.control_loop.states import ArmState
from tests.faults.expected import HOLD, OK, OTHER_REFUSED, TABLE, Arm, Cell, End
from tests.faults.phases import PHASES

_TARE = PHASES.index("tare")
_NO_FORCE = "no force is read while the arm's weight is measured"
_WEIGHED = replace(OK, why=_NO_FORCE)
_UNLOCKED = Cell(
    End.UNMEASURED,
    "Joint 7 is ",
    why="joint 7 is not locked while the arm moves; its position shows the motion",
)
_ASTRAY = Cell(
    End.UNMEASURED,
    why="detected by the deviation from the reference, not by the true speed",
)
_IN_VAIN = Cell(
    End.UNMEASURED,
    " does not turn although the arm is commanded to move.",
    why="detected when a commanded motor does not turn, by the next move at the latest",
)
_STEP = Cell(
    End.COMPLETE,
    why="in a move only the energy is checked; the step shows 0.5 J (limit 1 J)",
)
_MET = Cell(
    End.UNMEASURED,
    " N on the foot beyond its weight (limit 40)",
    arm=Arm(30, "driven", HOLD, "holding"),
)


def _too_fast(text: str) -> Cell:
    """Return the cell of an arm that exceeds its limits with no hand on it."""
    return Cell(
        End.UNMEASURED,
        text,
        arm=Arm(30, "idle", ArmState.IDLE, "idle"),
        why="no hand moves the arm: the excess may be an encoder error",
    )


_LATE = replace(TABLE["replies-late"][_TARE], end=End.UNMEASURED)
_OWN = {
    "joint7-slip": _UNLOCKED,
    "puck-changed": Cell(End.UNMEASURED, "IPNM of puck 3 was "),
    "replies-late": _LATE,
    "replies-late-2": _LATE,
    "replies-late-3": _LATE,
    "puck-late": _LATE,
    "hold-dragged": _ASTRAY,
    "overspeed": _too_fast("Joint 6 "),
    "joint-limit": _too_fast("Joint 6 at "),
    "torque-limit": _too_fast("Joint 2 would need "),
    "foot-speed": _too_fast("The foot moved at "),
    "lie-of-motor-3": _IN_VAIN,
    **{f"lie-of-motor-{motor}": _STEP for motor in (1, 2, 5, 6)},
    "contact-force": _MET,
    "second-command": OTHER_REFUSED,
}
_LAME = Cell(
    End.UNMEASURED,
    why="the arm is idled as it sinks, or because a motor does not turn as commanded",
)
_STOPPING = {End.ENDED, End.REPORTED, End.REDONE, End.SOMEHOW}


def _cell(fault: str) -> Cell:
    """Return the cell of a fault, by default derived from its cell of the tare."""
    if fault in _OWN:
        return _OWN[fault]
    at_tare = TABLE[fault][_TARE]
    if fault.startswith("stuck"):
        return _IN_VAIN
    if fault.startswith("dead"):
        return _LAME
    if fault.startswith("creep"):
        return _ASTRAY
    if fault.startswith("ft-"):
        return _WEIGHED
    if at_tare.end in _STOPPING:
        return replace(at_tare, end=End.UNMEASURED, rejected=(), why="")
    return replace(at_tare, why="")


MOVING_CELLS: dict[str, Cell] = {fault: _cell(fault) for fault in TABLE}
