"""The first day by its command: who is on the bus, the stop circuit, the rest pose."""

from collections.abc import Sequence

import numpy as np

from experiments.commissioning.evidence.order import GATED, StepId
from experiments.commissioning.evidence.record import Commissioning, read_commissioning
from experiments.commissioning.recording import read_raw
from experiments.commissioning.rest_pose import rest_pose
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
_CARRIED = 1.0  # s, in which hands bring the arm into a pose
_COMES_TO_REST = 0.5  # s, until an arm that is held or let go of is still
_FRICTION = "0.7"  # of the joints, as a share of what was identified on another arm
_STOPPED = 3  # exit code: a step found something wrong
_BEFORE_TORQUE = GATED[: GATED.index(StepId.REST_POSE)]
_BETWEEN = (StepId.RAMPS, StepId.LIFT)
_ON_REST_POSE = (StepId.REST_POSE, StepId.GRAVITY_RAMP)
_WRONG = "motor-2-weak"


def at_rest(room: MachineRoom) -> Figures:
    """Commission an arm on its rest pose: no torque in C8, its whole weight in C11.

    The steps before and between them, which take longer, are written into the record as
    sound. The command finds by itself that C8 is next, and then C11.
    """
    day = _laid_down(room, _pushed(room), *_BEFORE_TORQUE, *_BETWEEN)
    day.hand("activate")
    day.program.expect("The module braked", _STEP)
    day.hand("idle")
    day.hand("activate")
    room.finish(day.program, _STEP)
    record = _sound_record(room, GATED)
    return {
        "silence": _measured(record, StepId.REST_POSE, "a module that brakes"),
        "sole": _farthest(room, record),
    }


def wrong_arm(room: MachineRoom) -> Figures:
    """Commission an arm with a weak motor: C11 stops, the arm goes idle."""
    sound = GATED[: GATED.index(StepId.GRAVITY_RAMP)]
    day = _laid_down(room, _pushed(room, "--wrong", _WRONG), *sound)
    day.hand("activate")
    room.finish(day.program, _STEP, _STOPPED)
    record = _record(room)
    (wrong,) = [done for done in record.steps if done.cause]
    said = f"{wrong.step} stopped, in place of C11"
    require(wrong.step is StepId.GRAVITY_RAMP, said)
    require("Compensation moves the arm" in wrong.cause, wrong.cause)
    return {_WRONG: wrong.cause, "sole": _farthest(room, record)}


def _pushed(room: MachineRoom, *options: str) -> Program:
    """Return an arm with the friction of many, held by a hand that may let go of it."""
    return served_arm(room, "--friction", _FRICTION, *options)


def _laid_down(room: MachineRoom, arm: Program, *sound: StepId) -> LedSession:
    """Return a commissioning that waits for its arm, on the rest pose, to be activated.

    `sound`: steps that are taken as done. Hands lay the arm down before its pucks are
    woken: shorted windings would slow them.
    """
    angles = " ".join(f"{angle:.4f}" for angle in rest_pose(load_constants()))
    arm.press(f"pose {angles} {_CARRIED:g}\n")
    arm.run_on(_CARRIED + _COMES_TO_REST)
    take_as_commissioned(room.config, sound)
    day = LedSession(room, room.traction("commission", "--until", GATED[-1]), arm)
    day.program.expect("Lay the arm into its rest pose", _STEP)
    day.hand("release")
    day.program.run_on(_COMES_TO_REST)
    day.confirm()
    day.program.expect("Press Shift-activate", _STEP)
    return day


def _record(room: MachineRoom) -> Commissioning:
    record = read_commissioning(room.folder)
    if record is None:
        raise ScenarioError("no commissioning.json was written")
    return record


def _sound_record(room: MachineRoom, steps: Sequence[StepId]) -> Commissioning:
    """Return the record; raise ScenarioError where one of `steps` is not sound."""
    record = _record(room)
    sound = {done.step for done in record.steps if done.verdict == "sound"}
    missing = [step for step in steps if step not in sound]
    require(not missing, f"not sound: {', '.join(missing)}")
    return record


def _measured(record: Commissioning, step: StepId, words: str) -> str:
    """Return the quantity of a step whose name ends with `words`."""
    done = record.of(step)
    quantities = () if done is None else done.quantities
    (measured,) = [each for each in quantities if each.name.endswith(words)]
    return f"{measured.value:.3g} {measured.unit}"


def _farthest(room: MachineRoom, record: Commissioning) -> str:
    """Return in words how far the sole went at most in C8 or C11."""
    settings = load_settings(room.config)
    tool = build_tool(settings.rig, settings.matrix.terrains[0].foot)
    model = ArmModel(load_constants(), tool)
    travel = 0.0
    for step in _ON_REST_POSE:
        done = record.of(step)
        for raw in () if done is None else done.raw:
            path = model.sole_path(read_raw(room.folder, raw)["q"]).position
            travel = max(travel, float(np.linalg.norm(path - path[0], axis=1).max()))
    return f"{1e3 * travel:.1f} mm at most"
