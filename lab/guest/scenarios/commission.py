"""The first day by its command: who is on the bus, the stop circuit, the rest pose."""

from collections.abc import Mapping

import numpy as np

from experiments.commissioning.record import NAME, Commissioning, read_commissioning
from experiments.commissioning.steps import GATED, ProofStep
from experiments.proving.recording import Values, read_raw
from experiments.proving.rest_pose import liftoffs, rest_pose
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from lab.guest.commands import Program, ScenarioError, require
from lab.guest.commissioned import take_as_commissioned
from lab.guest.machine_room import MachineRoom
from lab.guest.network import set_up_both
from lab.guest.scenarios.bus import Figures
from lab.guest.sessions import LedSession
from wam.model.arm_model import ArmModel
from wam.model.constants import Array, load_constants

_STEP = 120.0  # s of guest time until it asks for the next thing
_BY_ITSELF = 90.0  # s, for C9 to C11: they ask for nothing
_CARRIED = 2.0  # s, in which hands bring the arm into a pose
_COMES_TO_REST = 0.7  # s, until an arm that is held or let go of is still
_STOPPED = 3  # exit code: a step found something wrong
_ON_THE_BUS = GATED[1 : GATED.index(ProofStep.BY_HAND)]
_BEFORE_TORQUE = GATED[: GATED.index(ProofStep.REST_POSE)]
_ON_REST_POSE = GATED[len(_BEFORE_TORQUE) :]
# Wrong arms, the step that has to stop at each, and words of its cause.
_WRONG = (
    ("pidx-3-is-2", ProofStep.IDENTITY, "PIDX of puck 3 is 2"),
    ("module-disobeys", ProofStep.STOP_CIRCUIT, "does not go back to idle"),
)


def first_day(room: MachineRoom) -> Figures:
    """Commission an arm: C1 to C4, then C8 to C11 on its rest pose.

    C0 touches no device and refuses this configuration's short loop test; C5 to C7 want
    a hand for many poses and send no torque. They are written into the record as sound,
    for the arm as it answers after C4 and `zero`: the command itself finds that C8 is
    next, and that nothing before it is stale.
    """
    arm = _served(room)
    day = _begun(room, arm, _ON_THE_BUS[0])
    _press_pendant(day)
    room.finish(day.program, _STEP)
    _lay(arm, load_constants().home)
    room.finish(room.traction("zero", "--yes"), _STEP)
    take_as_commissioned(room.config, _BEFORE_TORQUE)
    day = LedSession(room, room.traction("commission", "--until", GATED[-1]), arm)
    _lie_active(day)
    room.finish(day.program, _BY_ITSELF)
    record = _record(room)
    recorded = {
        done.step: read_raw(room.folder, done.raw[0])
        for done in record.steps
        if done.raw
    }
    return _figures(record, recorded)


def wrong_arms(room: MachineRoom) -> Figures:
    """Commission arms that are wrong: C2 stops at a puck's slot, C4 at the module."""
    figures: Figures = {}
    for name, step, words in _WRONG:
        arm = _served(room, "--wrong", name)
        day = _begun(room, arm, step)
        if step is ProofStep.STOP_CIRCUIT:
            _press_pendant(day)
        room.finish(day.program, _STEP, _STOPPED)
        arm.close()
        (cause,) = [done.cause for done in _record(room).steps if done.cause]
        require(words in cause, f"{name}: {cause}")
        figures[name] = f"{step}: {cause}"
        (room.folder / NAME).unlink()
    return figures


def _served(room: MachineRoom, *options: str) -> Program:
    """Return an arm at home with all its friction, its sensor on the bus."""
    set_up_both(room.shell)
    room.write_bus_config()
    return room.serve_home_arm("--hand", "none", *options)


def _begun(room: MachineRoom, arm: Program, first: ProofStep) -> LedSession:
    """Return a commissioning from a step up to C4."""
    words = ("--from", first, "--until", _ON_THE_BUS[-1])
    return LedSession(room, room.traction("commission", *words), arm)


def _press_pendant(day: LedSession) -> None:
    """Press the pendant as C4 asks."""
    for asked, button in (
        ("1/4 Press Shift-activate", "activate"),
        ("2/4 Press the stop button", "estop"),
    ):
        day.program.expect(asked, _STEP)
        day.hand(button)
    day.program.expect("3/4 Release the stop button", _STEP)
    day.confirm()
    day.program.expect("4/4 Press Shift-idle", _STEP)
    day.hand("idle")


def _lie_active(day: LedSession) -> None:
    """Lay the arm into its rest pose and activate it there, as C8 asks."""
    day.program.expect("Lay the arm into its rest pose", _STEP)
    _lay(day.arm, rest_pose(load_constants()))
    day.hand("release")
    day.arm.run_on(_COMES_TO_REST)
    day.confirm()
    day.program.expect("Press Shift-activate", _STEP)
    day.hand("activate")


def _lay(arm: Program, q: Array) -> None:
    """Let hands bring the joints to `q` [rad], shape (7,), and hold them there."""
    angles = " ".join(f"{angle:.4f}" for angle in q)
    arm.press(f"pose {angles} {_CARRIED:g}\n")
    arm.run_on(_CARRIED + _COMES_TO_REST)


def _record(room: MachineRoom) -> Commissioning:
    record = read_commissioning(room.folder)
    if record is None:
        raise ScenarioError("no commissioning.json was written")
    return record


def _figures(record: Commissioning, recorded: Mapping[ProofStep, Values]) -> Figures:
    """Return what was measured.

    Raises:
        ScenarioError: a step up to C11 is not there or not sound.
    """
    sound = {done.step for done in record.steps if done.verdict == "sound"}
    missing = [step for step in GATED if step not in sound]
    require(not missing, f"not sound: {', '.join(missing)}")
    timing = recorded[ProofStep.TIMING]
    p50, p99 = np.percentile(timing["replies_ns"], (50, 99)) / 1e6
    lifted = liftoffs(recorded[ProofStep.RAMPS])
    return {
        "exchange": f"{p50:.2f} ms (p99 {p99:.2f})",
        "answer": f"{float(timing['answer_ns']) / 1e6:.2f} ms",
        "idle loop": f"{timing['cycles']} cycles, {timing['incomplete']} incomplete",
        "stop": _measured(record, ProofStep.STOP_CIRCUIT, "pucks without power"),
        "lift-off": ", ".join(
            f"joint {abs(joint)} {torque:.2f} N m" for joint, torque in lifted.items()
        ),
        "sole": f"{1e3 * _travel(recorded):.1f} mm at most",
    }


def _measured(record: Commissioning, step: ProofStep, words: str) -> str:
    """Return the quantity of a step whose name ends with `words`."""
    done = record.of(step)
    quantities = () if done is None else done.quantities
    (found,) = [each for each in quantities if each.name.endswith(words)]
    return f"{found.value:.3g} {found.unit}"


def _travel(recorded: Mapping[ProofStep, Values]) -> float:
    """Return how far the sole went in any step on the rest pose [m]."""
    settings = load_settings(None)
    foot = settings.matrix.terrains[0].foot
    model = ArmModel(load_constants(), build_tool(settings.rig, foot))
    paths = (model.sole_path(recorded[step]["q"]).position for step in _ON_REST_POSE)
    return max(float(np.linalg.norm(path - path[0], axis=1).max()) for path in paths)
