"""Hold, damp or idle: the reason for each reaction and the travel of the sole.

An idle arm sinks. While positions and torques can be trusted, holding or damping with
gravity compensated is better; otherwise it would drive the arm blindly.
"""

from collections.abc import Mapping

from acquisition.control_loop.faults import FAULTS, Action, Fault
from tests.faults.bounds import PrintedBound, read_bounds
from tests.faults.phases import MOVING

HEAD = """
## Hold, damp or idle

The arm has no brakes: idle, it sinks. While positions and torques can be trusted, it is
held or damped with gravity compensated; otherwise that would drive it blindly.
`with it` is the travel of the sole within 0.5 s, `idle at once` the travel if the
safety module idles the arm at the same instant (`pendant-idle`): in an autonomous move,
and in the recording of a trial with the foot on the ground. From bounds.json.
"""
_POSITIONS = "positions are missing, outdated or wrong"
_TORQUES = "torques do not have the assumed effect"
_CIRCUIT = "the safety circuit has stopped the arm"
_TRUSTED = "positions and torques are valid"
_BEYOND = "valid as far as known; idle where damping does not slow the arm"
WHY: Mapping[Fault, str] = {
    Fault.E_STOP: _CIRCUIT,
    Fault.PENDANT_IDLE: _CIRCUIT,
    Fault.CAN_SILENCE: f"{_POSITIONS}: idle after 50 ms without them",
    Fault.REPLIES_LATE: f"{_POSITIONS}: confirmed within 20 ms",
    Fault.SAFETY_SILENT: "it is unknown whether the arm is driven: idle after 400 ms",
    Fault.POSITION_JUMP: f"{_POSITIONS}: idle after 50 ms without them",
    Fault.MOTOR_STALLED: _TORQUES,
    Fault.ENCODER_FROZEN: _POSITIONS,
    Fault.BUS_SHARED: f"{_TORQUES}: another program sends them, too",
    Fault.PUCK_CHANGED: _TORQUES,
    Fault.PUCK_DISOBEYS: _TORQUES,
    Fault.PUCK_DOUBLED: f"{_POSITIONS}: neither of two senders can be trusted",
    Fault.UNREQUESTED_ACTIVE: "no torques are ready: an active arm would fall",
    Fault.NOT_ACTIVE: "the next key press at the pendant would drive the arm",
    Fault.ACTIVATION_MOTION: _TORQUES,
    Fault.HOLD_MOTION: _TORQUES,
    Fault.DAMP_MOTION: _TORQUES,
    Fault.POWERED_TEST_MOTION: "only the stops are known to support the arm",
    Fault.KINETIC_ENERGY: _TORQUES,
    Fault.NOT_A_NUMBER: "there is no valid torque to send",
    Fault.JOINT_LIMIT: _BEYOND,
    Fault.OVERSPEED: _BEYOND,
    Fault.FOOT_SPEED: _BEYOND,
    Fault.TORQUE_LIMIT: _BEYOND,
    Fault.JOINT7_SLIP: _TRUSTED,
    Fault.FT_STALE: f"{_TRUSTED}; the control law does not use the force",
    Fault.FT_SATURATED: f"{_TRUSTED}; the control law does not use the force",
    Fault.CONTACT_FORCE: _TRUSTED,
    Fault.CONTACT_MOMENT: _TRUSTED,
    Fault.CONTACT_GROWTH: _TRUSTED,
    Fault.CONTACT_MOVE: f"{_TRUSTED}; the arm must not press on an obstacle",
    Fault.LOOP_LATE: _TRUSTED,
    Fault.LOOP_LOST: "the arm is driven by an outdated command",
    Fault.MOVE_REFUSED: _TRUSTED,
    Fault.CONSOLE_SILENT: f"{_TRUSTED}; the arm is unattended",
    Fault.CONSOLE_LOST: f"{_TRUSTED}; idle after 1 s without a parent process",
    Fault.RECORDER_SILENT: f"{_TRUSTED}; a full disk must not let the arm sink",
}
# Rows of the matrix that lead to the fault, where they do not have its name.
_ROWS = {
    Fault.UNREQUESTED_ACTIVE: "",
    Fault.NOT_ACTIVE: "",
    Fault.LOOP_LOST: "suspended-1-s",
    Fault.MOTOR_STALLED: "stuck-motor-2",
    Fault.ENCODER_FROZEN: "",
    Fault.HOLD_MOTION: "",
    Fault.POWERED_TEST_MOTION: "",
    Fault.CONTACT_MOVE: "contact-force",
}
_WORDS = {
    Action.HOLD: "hold",
    Action.DAMP: "damp",
    Action.IDLE: "idle",
    Action.END_TRIAL: "the trial ends",
}


def choice_lines() -> list[str]:
    """Return the table, a row for each fault of the guard."""
    titles = "fault | reaction | why | move: with it | idle at once | trial: with it"
    rows = [f"| {titles} | idle at once |", "|---" * 7 + "|"]
    bounds = read_bounds()
    idled = bounds[Fault.PENDANT_IDLE.value]
    for fault, spec in FAULTS.items():
        reaction = ", then ".join(_WORDS[action] for action in spec.actions)
        measured = bounds.get(_ROWS.get(fault, fault.value), {})
        cells = [f"`{fault.value}`", reaction, WHY[fault]]
        for phase in (MOVING, "recording"):
            cells += [_travel(measured.get(phase)), _travel(idled[phase])]
        rows.append(f"| {' | '.join(cells)} |")
    return rows


def _travel(bound: PrintedBound | None) -> str:
    return "-" if bound is None else f"{1e3 * bound.travel:.0f} mm"
