"""The first day by its command: who is on the bus, the stop circuit, the rest pose."""

from collections.abc import Sequence

import numpy as np

from experiments.commissioning.record import Commissioning, read_commissioning
from experiments.commissioning.steps import GATED, ProofStep
from experiments.proving.recording import Values, read_raw
from experiments.proving.rest_pose import liftoffs, rest_pose
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from lab.guest.commands import Program, ScenarioError, require
from lab.guest.commissioned import take_as_commissioned
from lab.guest.machine_room import MachineRoom
from lab.guest.scenarios.bus import Figures
from lab.guest.scenarios.losses import served_arm
from lab.guest.sessions import LedSession
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants

_STEP = 120.0  # s of guest time until it asks for the next thing, or has ended
_CARRIED = 2.5  # s, in which hands bring the arm into a pose
_COMES_TO_REST = 1.0  # s, until an arm that is held or let go of is still
_FRICTION = "0.7"  # of the joints, as a share of what was identified on another arm
_STOPPED = 3  # exit code: a step found something wrong
_BEFORE_TORQUE = GATED[: GATED.index(ProofStep.REST_POSE)]
_ON_REST_POSE = GATED[len(_BEFORE_TORQUE) :]
_WRONG = "motor-3-reversed"


def at_rest(room: MachineRoom) -> Figures:
    """Commission an arm with little torque: C8 to C11 on its rest pose.

    C0 to C7, which send none, are written into the record as sound. The command finds
    by itself that C8 is next, and nothing before it stale.
    """
    day = _rest_steps(room, _pushed(room))
    room.finish(day.program, _STEP)
    record = _sound_record(room, GATED)
    lifted = liftoffs(_recorded(room, record, ProofStep.RAMPS))
    return {
        "lift-off": ", ".join(
            f"joint {abs(joint)} {torque:.2f} N m" for joint, torque in lifted.items()
        ),
        "silence": _measured(record, ProofStep.REST_POSE, "a module that brakes"),
        "sole": _farthest(room, record),
    }


def wrong_arm(room: MachineRoom) -> Figures:
    """Commission an arm with a reversed motor: C9 stops, and says which."""
    day = _rest_steps(room, _pushed(room, "--wrong", _WRONG))
    room.finish(day.program, _STEP, _STOPPED)
    record = _record(room)
    (wrong,) = [done for done in record.steps if done.cause]
    require(wrong.step is ProofStep.RAMPS, f"{wrong.name} stopped, in place of C9")
    require("motor 3" in wrong.cause, wrong.cause)
    return {_WRONG: wrong.cause, "sole": _farthest(room, record)}


def _pushed(room: MachineRoom, *options: str) -> Program:
    """Return an arm with the friction of many, held by a hand that may let go of it."""
    return served_arm(room, "--friction", _FRICTION, *options)


def _rest_steps(room: MachineRoom, arm: Program) -> LedSession:
    """Return a commissioning that has its arm activated on the rest pose, in C8.

    Hands lay it down before its pucks are woken: shorted windings would slow them.
    """
    angles = " ".join(f"{angle:.4f}" for angle in rest_pose(load_constants()))
    arm.press(f"pose {angles} {_CARRIED:g}\n")
    arm.run_on(_CARRIED + _COMES_TO_REST)
    take_as_commissioned(room.config, _BEFORE_TORQUE)
    day = LedSession(room, room.traction("commission", "--until", GATED[-1]), arm)
    day.program.expect("Lay the arm into its rest pose", _STEP)
    day.hand("release")
    day.program.run_on(_COMES_TO_REST)
    day.confirm()
    day.program.expect("Press Shift-activate", _STEP)
    day.hand("activate")
    day.program.expect("The module braked", _STEP)
    day.hand("idle")
    day.hand("activate")
    return day


def _record(room: MachineRoom) -> Commissioning:
    record = read_commissioning(room.folder)
    if record is None:
        raise ScenarioError("no commissioning.json was written")
    return record


def _sound_record(room: MachineRoom, steps: Sequence[ProofStep]) -> Commissioning:
    """Return the record; raise ScenarioError where one of `steps` is not sound."""
    record = _record(room)
    sound = {done.step for done in record.steps if done.verdict == "sound"}
    missing = [step for step in steps if step not in sound]
    require(not missing, f"not sound: {', '.join(missing)}")
    return record


def _recorded(room: MachineRoom, record: Commissioning, step: ProofStep) -> Values:
    done = record.of(step)
    if done is None or not done.raw:
        raise ScenarioError(f"{step} has no recording")
    return read_raw(room.folder, done.raw[0])


def _measured(record: Commissioning, step: ProofStep, words: str) -> str:
    """Return the quantity of a step whose name ends with `words`."""
    done = record.of(step)
    quantities = () if done is None else done.quantities
    (measured,) = [each for each in quantities if each.name.endswith(words)]
    return f"{measured.value:.3g} {measured.unit}"


def _farthest(room: MachineRoom, record: Commissioning) -> str:
    """Return in words how far the sole went at most in a step of C8 to C11."""
    settings = load_settings(room.config)
    tool = build_tool(settings.rig, settings.matrix.terrains[0].foot)
    model = ArmModel(load_constants(), tool)
    travel = 0.0
    for step in _ON_REST_POSE:
        if record.of(step) is not None:
            path = model.sole_path(_recorded(room, record, step)["q"]).position
            travel = max(travel, float(np.linalg.norm(path - path[0], axis=1).max()))
    return f"{1e3 * travel:.1f} mm at most"
