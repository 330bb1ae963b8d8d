"""Hold, damp or idle: the reason for each reaction and the travel of the sole.

An idle arm sinks. Where positions and torques can be trusted, holding or damping with
the weight compensated is better; where they cannot, it would drive an arm blindly.
"""

from collections.abc import Mapping

from acquisition.control_loop.faults import FAULTS, Action, Fault
from tests.faults.bounds import PrintedBound, read_bounds
from tests.faults.phases import MOVING

HEAD = """
## Hold, damp or idle

An idle arm has no brakes and sinks. So it is held or damped, its weight compensated,
where positions and torques can be trusted; where they cannot, that would drive it
blindly. `with it` is how far the sole gets within 0.5 s, `idle at once` what it does
when the module idles it at the same instant (`pendant-idle`): in a move of the arm by
itself, and in the recording of a trial, the foot on the ground. From bounds.json.
"""
_POSITIONS = "positions are missing, old or false"
_TORQUES = "torques do not do what they are taken to do"
_CIRCUIT = "the safety circuit decides"
_TRUSTED = "positions and torques are sound"
_BEYOND = "sound, as far as is known; idle where damping does not slow it"
WHY: Mapping[Fault, str] = {
    Fault.E_STOP: _CIRCUIT,
    Fault.PENDANT_IDLE: _CIRCUIT,
    Fault.CAN_SILENCE: f"{_POSITIONS}: 50 ms are waited for them",
    Fault.REPLIES_LATE: f"{_POSITIONS}: confirmed within 20 ms",
    Fault.SAFETY_SILENT: "nobody knows whether the arm is driven: 400 ms are waited",
    Fault.POSITION_JUMP: f"{_POSITIONS}: 50 ms are waited for them",
    Fault.MOTOR_STALLED: _TORQUES,
    Fault.ENCODER_FROZEN: _POSITIONS,
    Fault.BUS_SHARED: f"{_TORQUES}: they are another program's too",
    Fault.PUCK_CHANGED: _TORQUES,
    Fault.PUCK_DISOBEYS: _TORQUES,
    Fault.PUCK_DOUBLED: f"{_POSITIONS}: no second one is to be believed",
    Fault.UNREQUESTED_ACTIVE: "no torque is ready: active, it would fall",
    Fault.NOT_ACTIVE: "the next press of the pendant would drive it",
    Fault.ACTIVATION_MOTION: _TORQUES,
    Fault.HOLD_MOTION: _TORQUES,
    Fault.DAMP_MOTION: _TORQUES,
    Fault.POWERED_TEST_MOTION: "nothing is known to bear the arm but its stops",
    Fault.KINETIC_ENERGY: _TORQUES,
    Fault.NOT_A_NUMBER: "there is no torque to send",
    Fault.JOINT_LIMIT: _BEYOND,
    Fault.OVERSPEED: _BEYOND,
    Fault.FOOT_SPEED: _BEYOND,
    Fault.TORQUE_LIMIT: _BEYOND,
    Fault.JOINT7_SLIP: _TRUSTED,
    Fault.FT_STALE: f"{_TRUSTED}; force commands nothing",
    Fault.FT_SATURATED: f"{_TRUSTED}; force commands nothing",
    Fault.CONTACT_FORCE: _TRUSTED,
    Fault.CONTACT_MOMENT: _TRUSTED,
    Fault.CONTACT_GROWTH: _TRUSTED,
    Fault.CONTACT_MOVE: f"{_TRUSTED}; what is in the way is not pressed on",
    Fault.LOOP_LATE: _TRUSTED,
    Fault.LOOP_LOST: "it is driven by what it did long ago",
    Fault.MOVE_REFUSED: _TRUSTED,
    Fault.CONSOLE_SILENT: f"{_TRUSTED}; nobody watches",
    Fault.CONSOLE_LOST: f"{_TRUSTED}; idle after 1 s without a parent",
    Fault.RECORDER_SILENT: f"{_TRUSTED}; a full disk lets nothing sink",
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
