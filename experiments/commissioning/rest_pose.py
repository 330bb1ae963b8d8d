"""C8 to C11: powered tests with little torque, the arm lying on its stops."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.control_loop.faults import CircuitCauses, Fault, GuardVerdict
from acquisition.control_loop.powered_tests import (
    POWERED_TEST_LIMITS,
    PoweredTestGoal,
    PoweredTestKind,
)
from acquisition.devices import SHORTED, SafetyMode
from acquisition.errors import PreflightError
from acquisition.sample import MOTOR_FRESH_SHIFT, SAFETY_MODE_MASK
from acquisition.simulation import PendantAction
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.judging import (
    JudgedQuantity,
    Judgement,
    judge_quantity,
    judged,
)
from experiments.commissioning.recording import Values, texts, words
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step
from experiments.messages import preflight_error
from experiments.run.stop import ArmFaultError
from wam.model.constants import ArmConstants, Array

# Joints in test order, signed by the direction of motion: least loaded first.
PUSHED = (1, -1, 3, -3, 5, -5, 7, -7, 2, -4, -6)
LIFTED = (2, -4, -6)  # joints that carry weight in the rest pose
_RAMP_SECONDS = 1.0
_AFTER = 0.3  # s, recorded after the end of a ramp
_REST = 0.6  # s, without torque at the end of a test
_STILL = 1.0  # s, duration of C8
_LIFT_SECONDS = (
    2 * POWERED_TEST_LIMITS.lift_travel / POWERED_TEST_LIMITS.lift_speed + 0.6
)
_GRAVITY_SECONDS, _GRAVITY_KEPT = 1.4, 0.6
_ON_POSE = 0.12  # rad, tolerance of the rest pose
_PATIENCE = 120.0  # s, time-out of the activation
# Section of a lift in which torque is averaged, as shares of the travel reached: the
# rest at the top, where friction reverses, is left out however far the joint came.
_MIDDLE = (0.3, 0.8)
# Tolerance of the measured weights: N m by joint, for masses of the drawings, and a
# relative one.
_WEIGHT_TOLERANCE: Mapping[int, float] = {2: 2.0, -4: 0.7, -6: 0.25}
_RELATIVE_TOLERANCE = 0.2
_CARRIED = 8.0  # s, time of a simulated hand to lay the arm down


def rest_pose(constants: ArmConstants) -> Array:
    """Pose in which all joints that carry weight lie on stops [rad], shape (7,)."""
    q = constants.home.copy()
    q[5] = constants.q_upper[5]
    return q


def lay_down(scene: Scene) -> None:
    """Have the arm laid into its rest pose, then activated without torque.

    Raises:
        PreflightError: the arm is not in the pose, or was not activated in time.
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    if scene.is_testing:
        return
    q = rest_pose(scene.rig.model.constants)
    scene.ask(
        "Lay the arm into its rest pose: home, and joint 6 turned onto its stop at "
        f"{q[5]:+z.2f} rad. Take the hands off it. [space] when it lies there."
    )
    if scene.simulation is not None:
        scene.simulation.pose(q.tolist(), _CARRIED)
        scene.await_hand()
        scene.simulation.let_go()
        scene.wait(1.0)
    position = scene.loop_client.latest()["position"][0]
    joint = int(np.abs(position - q).argmax())
    if abs(position[joint] - q[joint]) > _ON_POSE:
        raise PreflightError(
            f"Joint {joint + 1} is at {position[joint]:.2f} rad, in the rest pose it "
            f"is at {q[joint]:.2f}.",
            hint="Lay the arm onto its stops and begin the step again.",
            arm_state="idle; it sinks slowly, support it",
        )
    _activate(scene, "Press Shift-activate.", "activate")


def _activate(scene: Scene, text: str, *presses: PendantAction) -> None:
    """Have the lying arm activated without torque; raises as `lay_down`."""
    scene.loop_client.start()
    scene.start_powered_test(PoweredTestGoal(PoweredTestKind.REST))
    scene.wait(0.1)
    scene.say(f"{text} Keep the hands off the arm: it gets no torque.")
    if scene.simulation is not None:
        for press in presses:
            scene.simulation.pendant(press)
    waited = 0.0
    while scene.loop_client.status.safety is not SafetyMode.ACTIVE:
        scene.wait(0.1)
        waited += 0.1
        if waited > _PATIENCE:
            raise preflight_error("not-active", seconds=_PATIENCE)
    scene.is_testing = True


def rest(scene: Scene) -> Values:
    """Activate the arm without torque and record it."""
    reader = scene.rig.shared.cycles.reader()
    ended = scene.until_fault(lambda: lay_down(scene), _STILL)
    record = reader.read()
    active = record[record["flags"] & SAFETY_MODE_MASK == SafetyMode.ACTIVE]
    return {
        "t_ns": active["host_ns"].astype(np.int64),
        "q": active["position"].copy(),
        "tau": active["torque_command"].copy(),
        "ended": texts(ended),
    }


def rest_and_silence(scene: Scene) -> Values:
    """Run `rest`, then stop all requests until the module's heartbeat brakes.

    After braking the module must be activated again at the pendant.
    """
    values = rest(scene)
    if words(values, "ended"):
        return values
    scene.show_share(0.8, "nothing is asked for: the module has to brake")
    reader = scene.rig.shared.cycles.reader()
    scene.start_powered_test(
        PoweredTestGoal(PoweredTestKind.SILENCE, seconds=POWERED_TEST_LIMITS.silence)
    )
    ended: list[str] = []
    try:
        scene.wait(POWERED_TEST_LIMITS.silence + _AFTER)
    except ArmFaultError as fault:
        text = scene.fault_words(fault)
        if not is_heartbeat(fault.verdict):
            ended = [text]
    record = reader.read()
    if not (ended or scene.is_testing):
        text = "The module braked. Press Shift-idle, then Shift-activate."
        _activate(scene, text, "idle", "activate")
    return {
        **values,
        "ended": texts(ended),
        "silent_ns": record["host_ns"].astype(np.int64),
        "silent_mode": (record["flags"] & SAFETY_MODE_MASK).astype(np.int64),
        "silent_fresh": (record["flags"] >> MOTOR_FRESH_SHIFT & 0x7F).astype(np.int64),
    }


def is_heartbeat(verdict: GuardVerdict) -> bool:
    """Return whether the module went idle by its heartbeat, not by a press."""
    causes = verdict.detail.causes if isinstance(verdict.detail, CircuitCauses) else ()
    return verdict.fault is Fault.PENDANT_IDLE and "heartbeat" in causes


def judge_rest(values: Values) -> Judgement:
    """Judge an active arm without torque, and its module's heartbeat."""
    rows = rest_rows(values)
    if "silent_ns" in values:  # absent after a fault and in the daily check
        rows.append(judge_quantity("silence", _braked_after(values)))
    return judged(rows)


def _braked_after(values: Values) -> float:
    """Time from the last position to the braking of the module [ms].

    The whole silence if the module did not brake.
    """
    t_ns, mode = values["silent_ns"], values["silent_mode"]
    is_braked = np.isin(mode, [int(shorted) for shorted in SHORTED])
    if not is_braked.any():
        return 1e3 * POWERED_TEST_LIMITS.silence
    first = int(is_braked.argmax())
    heard = np.flatnonzero(values["silent_fresh"][:first])
    last = int(heard[-1]) if heard.size else 0
    return float(t_ns[first] - t_ns[last]) * 1e-6


def rest_rows(values: Values) -> list[JudgedQuantity]:
    """Quantities of an active arm without torque."""
    seconds = _seconds(values["t_ns"])
    rows = [
        judge_quantity(
            "rest", 1e3 * travel, high=1e3 * POWERED_TEST_LIMITS.rest[i], joint=i + 1
        )
        for i, travel in enumerate(_travels(values["q"]))
    ]
    return [*rows, *_ended_row(values), judge_quantity("active", seconds)]


def ramps(scene: Scene, joints: Sequence[int] = PUSHED) -> Values:
    """Ramp the torque of one joint after another, each until it moves."""
    lay_down(scene)
    constants, q = scene.rig.model.constants, scene.position()
    weights = scene.rig.law_model.gravity(q)
    goals: list[PoweredTestGoal] = []
    for signed in joints:
        i = abs(signed) - 1
        torque = 2.0 * float(constants.coulomb[i])
        if signed in LIFTED:
            torque += 1.3 * abs(float(weights[i]))
        torque = min(torque, 0.9 * scene.rig.settings.rig.limits.torque[i])
        sense = 1.0 if signed > 0 else -1.0
        goals.append(
            PoweredTestGoal(PoweredTestKind.RAMP, i + 1, sense * torque, _RAMP_SECONDS)
        )
    values = _run_tests(scene, goals, _RAMP_SECONDS + _AFTER)
    return {**values, "weights": weights}


def judge_ramps(values: Values) -> Judgement:
    """Judge direction and lift-off torque of each joint."""
    return judged(ramp_rows(values))


def liftoffs(values: Values) -> dict[int, float]:
    """Lift-off torque of each joint [N m], by joint signed with its direction.

    Args:
        values: recording of `ramps`; joints not reached are left out.
    """
    torques: dict[int, float] = {}
    for k, (joint, torque) in enumerate(
        zip(values["joints"].tolist(), values["torques"].tolist(), strict=True)
    ):
        part, signed = values["proof"] == k, int(np.copysign(joint, torque))
        if signed in LIFTED and part.any():  # a ramp ends where the joint moves
            torques[signed] = float(np.abs(values["tau"][part][:, joint - 1]).max())
    return torques


def ramp_rows(values: Values) -> list[JudgedQuantity]:
    """Quantities of the ramped joints."""
    lifted = liftoffs(values)
    rows: list[JudgedQuantity] = []
    for number, (joint, torque) in enumerate(
        zip(values["joints"].tolist(), values["torques"].tolist(), strict=True)
    ):
        part = values["proof"] == number
        if not part.any():
            break
        i, sense = int(joint) - 1, 1.0 if torque > 0 else -1.0
        q = values["q"][part]
        travels = np.abs(q - q[0]).max(axis=0)
        travels[i] = 0.0
        limits = np.array(
            [POWERED_TEST_LIMITS.other_joint_travel(i + 1, j) for j in range(1, 8)]
        )
        other = int((travels / limits).argmax())
        rows.append(
            judge_quantity(
                "aside",
                1e3 * travels[other],
                high=1e3 * limits[other],
                joint=i + 1,
                other=other + 1,
                pushed=_signed(i, sense),
            )
        )
        travel = sense * (q[:, i] - q[0, i])
        reach = POWERED_TEST_LIMITS.reach[i]
        rows.append(
            judge_quantity(
                "moved", 1e3 * travel.max(), low=1e3 * reach, joint=_signed(i, sense)
            )
        )
        if (needed := lifted.get(int(sense) * (i + 1))) is not None:
            weight = abs(float(values["weights"][i]))
            rows.append(judge_quantity("liftoff", needed / weight, joint=i + 1))
    return [*rows, *_ended_row(values)]


def lift(scene: Scene) -> Values:
    """Lift the joints that carry weight off their stops and lay them back."""
    lay_down(scene)
    constants, q = scene.rig.model.constants, scene.position()
    weights = scene.rig.law_model.gravity(q)
    goals: list[PoweredTestGoal] = []
    for signed in LIFTED:
        i = abs(signed) - 1
        limit = 1.5 * (abs(float(weights[i])) + float(constants.coulomb[i]))
        limit = min(limit, 0.9 * scene.rig.settings.rig.limits.torque[i])
        goals.append(
            PoweredTestGoal(
                PoweredTestKind.LIFT, i + 1, limit if signed > 0 else -limit
            )
        )
    values = _run_tests(scene, goals, _LIFT_SECONDS)
    model = scene.rig.law_model
    predicted = np.array([model.gravity(row) for row in values["q"]]).reshape(-1, 7)
    return {**values, "predicted": predicted}


def judge_lift(values: Values) -> Judgement:
    """Judge the joints' weights: means of up and down, so that friction cancels."""
    rows: list[JudgedQuantity] = []
    for number, (joint, torque) in enumerate(
        zip(values["joints"].tolist(), values["torques"].tolist(), strict=True)
    ):
        part = values["proof"] == number
        if not part.any():
            break
        i, sense = int(joint) - 1, 1.0 if torque > 0 else -1.0
        q, tau = values["q"][part][:, i], sense * values["tau"][part][:, i]
        travel = sense * (q - q[0])
        rows.append(judge_quantity("lifted", 1e3 * travel.max(), joint=i + 1))
        if not rows[-1].measured.is_within:
            continue
        low, high = (share * travel.max() for share in _MIDDLE)
        inside = (travel > low) & (travel < high)
        before = np.arange(len(travel)) < int(travel.argmax())
        up, down = tau[inside & before], tau[inside & ~before]
        if len(up) and len(down):
            weight = (up.mean() + down.mean()) / 2
            predicted = sense * values["predicted"][part][inside, i].mean()
            tolerance = min(
                _WEIGHT_TOLERANCE[int(sense) * (i + 1)] / abs(predicted),
                _RELATIVE_TOLERANCE,
            )
            low, high = 1.0 - tolerance, 1.0 + tolerance
            ratio = weight / predicted
            rows.append(
                judge_quantity("weight", ratio, low=low, high=high, joint=i + 1)
            )
    return judged([*rows, *_ended_row(values)])


def gravity_ramp(scene: Scene) -> Values:
    """Ramp the gravity compensation to full strength."""
    lay_down(scene)
    goal = PoweredTestGoal(PoweredTestKind.GRAVITY, seconds=_GRAVITY_SECONDS)
    return _run_tests(scene, [goal], _GRAVITY_SECONDS + _GRAVITY_KEPT)


def judge_gravity_ramp(values: Values) -> Judgement:
    """Judge whether the compensation moves the lying arm."""
    limits = [1e3 * POWERED_TEST_LIMITS.gravity * m for m in POWERED_TEST_LIMITS.rest]
    rows = [
        judge_quantity("gravity", 1e3 * travel, high=limits[i], joint=i + 1)
        for i, travel in enumerate(_travels(values["q"]))
    ]
    share = _seconds(values["t_ns"]) / _GRAVITY_SECONDS
    return judged(
        [
            *rows,
            *_ended_row(values),
            judge_quantity("share", share, text="The ramp ended early"),
        ]
    )


def _run_tests(
    scene: Scene, goals: Sequence[PoweredTestGoal], seconds: float
) -> Values:
    """Run one powered test after another until one ends in idle; returns the record."""
    parts: list[NDArray[Any]] = []
    numbers: list[NDArray[Any]] = []
    ended: list[str] = []
    for number, goal in enumerate(goals):
        scene.show_share(number / len(goals), _words(goal))
        scene.start_powered_test(goal)
        reader = scene.rig.shared.cycles.reader()
        # A test ends without torque, the arm lying down within its own limits.
        ended = scene.until_fault(lambda: None, seconds + _REST)
        part = reader.read()
        parts.append(part)
        numbers.append(np.full(len(part), number))
        if ended:
            break
    record = np.concatenate(parts)
    return {
        "proof": np.concatenate(numbers),
        "joints": np.array([goal.joint for goal in goals]),
        "torques": np.array([goal.torque for goal in goals]),
        "t_ns": record["host_ns"].astype(np.int64),
        "q": record["position"].copy(),
        "tau": record["torque_command"].copy(),
        "ended": texts(ended),
    }


def _words(goal: PoweredTestGoal) -> str:
    if goal.kind is PoweredTestKind.GRAVITY:
        return "compensation grows"
    return f"joint {goal.joint}, up to {goal.torque:+z.1f} N m"


def _signed(i: int, sense: float) -> str:
    return f"{i + 1}{'+' if sense > 0 else '-'}"


def _travels(q: NDArray[Any]) -> Array:
    """Largest travel of each joint from its initial position [rad], shape (7,)."""
    return np.abs(q - q[0]).max(axis=0) if len(q) else np.zeros(7)


def _seconds(t_ns: NDArray[Any]) -> float:
    return float(t_ns[-1] - t_ns[0]) * 1e-9 if len(t_ns) else 0.0


def _ended_row(values: Values) -> list[JudgedQuantity]:
    ended = words(values, "ended")
    return [judge_quantity("ended", len(ended), text=" ".join(ended))]


REST_POSE = Step(
    StepId.REST_POSE,
    rest_and_silence,
    judge_rest,
    minutes=5,
    remedy="Lay the arm down again with nothing leaning on it; look at the mounting.",
    needs_loop=True,
    needs_zero=True,
)
RAMPS = Step(
    StepId.RAMPS,
    ramps,
    judge_ramps,
    minutes=2,
    remedy="Switch the arm off and look at the motor that is named, and its cables.",
    needs_loop=True,
    needs_zero=True,
)
LIFT = Step(
    StepId.LIFT,
    lift,
    judge_lift,
    minutes=2,
    remedy="Weigh the foot; look at the zero position and at the drive cables.",
    needs_loop=True,
    needs_zero=True,
)
GRAVITY_RAMP = Step(
    StepId.GRAVITY_RAMP,
    gravity_ramp,
    judge_gravity_ramp,
    minutes=1,
    remedy="Weigh the foot; look at mounting, zero position and gravity calibration.",
    needs_loop=True,
    needs_zero=True,
)
