"""Commissioning by its command: steps C8 (rest pose) and C11 (gravity ramp)."""

from collections.abc import Sequence

import numpy as np

from experiments.commissioning.evidence.order import GATED, StepId
from experiments.commissioning.evidence.record import Commissioning, read_commissioning
from experiments.commissioning.recording import read_raw
from experiments.commissioning.rest_pose import rest_pose
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from lab.guest.commands import Program, ScenarioError, require
from lab.guest.commissioned import write_passed_commissioning
from lab.guest.machine_room import MachineRoom
from lab.guest.scenarios.bus import Figures
from lab.guest.scenarios.losses import served_arm
from lab.guest.sessions import LedSession
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants

_STEP = 120.0  # s of guest time until the next prompt, or the end
_POSE_TIME = 1.0  # s in which the operator moves the arm to a pose
_SETTLING = 0.5  # s until a held or released arm is still
_FRICTION = "0.7"  # joint friction relative to that identified on another arm
_STOPPED = 3  # exit code: a step failed
_BEFORE_TORQUE = GATED[: GATED.index(StepId.REST_POSE)]
_BETWEEN = (StepId.RAMPS, StepId.LIFT)
_ON_REST_POSE = (StepId.REST_POSE, StepId.GRAVITY_RAMP)
_WRONG = "motor-2-weak"


def at_rest(room: MachineRoom) -> Figures:
    """Commission an arm in its rest pose: no torque in C8, its whole weight in C11.

    The steps before and between these take longer and are entered as passed in the
    record. The command selects C8 and then C11 as the next steps by itself.
    """
    day = _laid_down(room, _pushed(room), *_BEFORE_TORQUE, *_BETWEEN)
    day.hand("activate")
    day.program.expect("The module braked", _STEP)
    day.hand("idle")
    day.hand("activate")
    room.finish(day.program, _STEP)
    record = _sound_record(room, GATED)
    return {
        "silence": _quantity(record, StepId.REST_POSE, "until the module idles"),
        "sole": _sole_travel(room, record),
    }


def wrong_arm(room: MachineRoom) -> Figures:
    """Commission an arm with a weak motor: C11 stops and the arm goes idle."""
    sound = GATED[: GATED.index(StepId.GRAVITY_RAMP)]
    day = _laid_down(room, _pushed(room, "--wrong", _WRONG), *sound)
    day.hand("activate")
    room.finish(day.program, _STEP, _STOPPED)
    record = _record(room)
    (wrong,) = [done for done in record.steps if done.cause]
    text = f"{wrong.step} stopped instead of C11"
    require(wrong.step is StepId.GRAVITY_RAMP, text)
    require("Compensation moves the arm" in wrong.cause, wrong.cause)
    return {_WRONG: wrong.cause, "sole": _sole_travel(room, record)}


def _pushed(room: MachineRoom, *options: str) -> Program:
    """Start an arm with realistic friction, held by an operator who may release it."""
    return served_arm(room, "--friction", _FRICTION, *options)


def _laid_down(room: MachineRoom, arm: Program, *sound: StepId) -> LedSession:
    """Start a commissioning up to the activation of the arm in its rest pose.

    `sound` are the steps recorded as passed. The operator lays the arm down before the
    pucks are woken, since shorted windings would brake it.
    """
    angles = " ".join(f"{angle:.4f}" for angle in rest_pose(load_constants()))
    arm.press(f"pose {angles} {_POSE_TIME:g}\n")
    arm.run_on(_POSE_TIME + _SETTLING)
    write_passed_commissioning(room.config, sound)
    day = LedSession(room, room.traction("commission", "--until", GATED[-1]), arm)
    day.program.expect("Lay the arm into its rest pose", _STEP)
    day.hand("release")
    day.program.run_on(_SETTLING)
    day.confirm()
    day.program.expect("Press Shift-activate", _STEP)
    return day


def _record(room: MachineRoom) -> Commissioning:
    record = read_commissioning(room.folder)
    if record is None:
        raise ScenarioError("no commissioning.json was written")
    return record


def _sound_record(room: MachineRoom, steps: Sequence[StepId]) -> Commissioning:
    """Return the record; raise ScenarioError if one of `steps` has not passed."""
    record = _record(room)
    sound = {done.step for done in record.steps if done.verdict == "sound"}
    missing = [step for step in steps if step not in sound]
    require(not missing, f"not sound: {', '.join(missing)}")
    return record


def _quantity(record: Commissioning, step: StepId, ending: str) -> str:
    """Return the value of a step's quantity whose name ends with `ending`."""
    done = record.of(step)
    quantities = () if done is None else done.quantities
    (quantity,) = [q for q in quantities if q.name.endswith(ending)]
    return f"{quantity.value:.3g} {quantity.unit}"


def _sole_travel(room: MachineRoom, record: Commissioning) -> str:
    """Return the largest distance of the sole from its start in C8 and C11, as text."""
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
