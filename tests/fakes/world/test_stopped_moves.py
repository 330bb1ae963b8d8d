"""Every fault of the guard stops the true joints of an arm that moves by itself."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.control_loop.details import StalledMotor
from acquisition.control_loop.faults import FAULTS, Fault, verdict_for
from acquisition.control_loop.states import ArmState
from fakes.world.rig import LocalSimulation
from tests.fakes.world.holding import LIMITS, RATE, HoldBench
from wam.bus.frames import position_reply_id

pytestmark = pytest.mark.slow

SPEED = 0.5  # rad/s, the fastest a move is
OFFSETS = np.array([0.6, -0.45, 0.3, 0.6, 0.45, -0.6, 0.3])  # rad
MIDDLE = 1.0  # s after the start; the arm moves at full speed
STOP = 0.75  # s within which it stands, the last swing included
# 0.5 rad/s until the guard detects the fault, and the stopping distance [rad].
TRAVEL = 0.08
STILL = 3e-3  # rad in half a second
# Idle, it sinks on its windings; until then it may have lost a motor [rad/s].
SINKING, FALLING = 0.8, 3.0


def move(bench):
    """Start a move, let it reach the middle and return its goal."""
    goal = bench.plant.q + OFFSETS
    bench.cycle.move_to(goal.tolist(), SPEED)
    bench.run(MIDDLE)
    assert np.abs(bench.plant.qd).max() > 0.8 * SPEED
    return goal


def check_stopped(bench, begin, *, travel=TRAVEL):
    """Check that the arm stops within `travel` of `begin`, its pose at the fault."""
    seen, speeds = [], []
    for _ in range(round((STOP + 0.5) * RATE)):
        seen.append(bench.step())
        speeds.append(np.abs(bench.plant.qd))
    if bench.plant.is_idle:
        assert np.max(speeds) < FALLING
        assert np.max(speeds[-250:]) < SINKING
        return
    q = np.array(seen)
    assert np.abs(q - begin).max() < travel
    assert np.ptp(q[-250:], axis=0).max() < STILL


def tighten(**limits):
    def strike(bench):
        bench.cycle.limits = replace(LIMITS, **limits)

    return strike


def too_weak(bench):
    """Lower a torque limit below the weight for one cycle; the arm would fall."""
    bench.cycle.limits = replace(LIMITS, torque=(20.0, 0.5, 15.0, 15.0, 2.5, 2.5, 1.3))
    bench.step()
    bench.cycle.limits = LIMITS


def at_the_stop(bench):
    upper = list(LIMITS.q_upper)
    upper[3] = float(bench.plant.q[3]) - 0.01
    bench.cycle.limits = replace(LIMITS, q_upper=tuple(upper))


def inject(name):
    return lambda bench: LocalSimulation(bench.rig).inject(name)


def report(fault):
    return lambda bench: bench.cycle.report(verdict_for(fault, FAULTS[fault].detail()))


HOLDING = {
    "joint-limit": at_the_stop,
    "torque-limit": too_weak,
    "overspeed": tighten(speed=(0.45,) * 7),
    "loop-late": inject("loop-late"),
}
BRAKED = (
    "reply-lost-10",
    "puck-silent",
    "puck-reboot",
    "can-silence",
    "bus-off",
    "interface-down",
    "unacknowledged",
    "pendant-idle",
    "safety-speed",
    "safety-torque",
    "safety-heartbeat",
    "safety-silent",
    "position-jump",
)
WITHOUT_DETAIL = [f for f in Fault if len(FAULTS[f].detail.__dataclass_fields__) == 0]


@pytest.mark.parametrize("name", HOLDING)
def test_a_fault_of_motion_or_cadence_stops_a_move(name):
    bench = HoldBench()
    move(bench)
    begin = bench.plant.q.copy()
    HOLDING[name](bench)
    check_stopped(bench, begin)
    assert bench.cycle.status.verdict.reason == name
    assert bench.cycle.status.state in {ArmState.HOLD, ArmState.DAMP}


@pytest.mark.parametrize("name", BRAKED)
def test_a_fault_that_brakes_the_arm_stops_a_move(name):
    bench = HoldBench()
    move(bench)
    begin = bench.plant.q.copy()
    inject(name)(bench)
    # 0.4 s until a silent safety module counts as silent; holding since 0.25 s.
    check_stopped(bench, begin, travel=0.2 if name == "safety-silent" else TRAVEL)
    assert bench.plant.is_idle or bench.cycle.status.state is ArmState.HOLD


def test_the_stop_button_ends_a_move_for_good():
    bench = HoldBench()
    move(bench)
    inject("estop")(bench)
    bench.run(0.1)
    assert bench.cycle.status.state is ArmState.IDLE
    bench.enter(ArmState.HOLD)  # a new hold is no old move
    assert np.abs(bench.law.torque(bench.arm.read(bench.clock.now_ns()))[0]).max() < 46


@pytest.mark.parametrize("fault", WITHOUT_DETAIL)
def test_an_external_verdict_stops_a_move(fault):
    bench = HoldBench()
    move(bench)
    begin = bench.plant.q.copy()
    report(fault)(bench)
    check_stopped(bench, begin)
    assert bench.cycle.status.verdict.fault is fault


def test_a_stopped_move_does_not_resume_after_the_fault():
    bench = HoldBench()
    goal = move(bench)
    bench.cycle.limits = replace(LIMITS, speed=(0.45,) * 7)
    bench.run(0.5)
    bench.cycle.limits = LIMITS
    bench.enter(ArmState.HOLD)
    q = bench.run(1.0)
    assert np.ptp(q, axis=0).max() < STILL
    assert np.abs(q[-1] - goal).max() > 0.1


def test_no_move_begins_while_a_verdict_is_active():
    bench = HoldBench()
    goal = move(bench)
    report(Fault.CONSOLE_SILENT)(bench)
    bench.run(0.5)
    bench.cycle.move_to(goal.tolist(), SPEED)
    q = bench.run(0.5)
    assert np.ptp(q, axis=0).max() < STILL
    bench.enter(ArmState.HOLD)
    bench.cycle.move_to(goal.tolist(), SPEED)
    bench.run(2.5)
    assert np.abs(bench.plant.q - goal).max() < 0.02


def test_a_pending_move_is_discarded_by_a_hold_request():
    bench = HoldBench()
    bench.cycle.move_to((bench.plant.q + OFFSETS).tolist(), SPEED)
    bench.cycle.request(ArmState.HOLD)
    assert np.ptp(bench.run(0.5), axis=0).max() < STILL


def test_stopping_a_move_at_rest_causes_no_torque_step():
    bench = HoldBench(error=0.6)
    bench.cycle.move_to((bench.plant.q + 0.02).tolist(), 0.1)
    bench.run(1.5)  # at the goal, and held against a wrong weight
    bench.sent.clear()
    bench.run(0.01)
    bench.enter(ArmState.HOLD)
    bench.run(0.01)
    assert np.abs(np.array(bench.sent[-1]) - bench.sent[0])[:4].max() < 0.5


def freeze(bench, motor):
    """Freeze the reported position of a motor."""
    here = bench.plant.counts()[motor - 1]
    bench.rig.network.faults.falsify(position_reply_id(motor), lambda _: here)


def worst_speed(bench, seconds):
    """Let time pass; return the largest true speed as a share of its limit."""
    shares = []
    for _ in range(round(seconds * 500)):
        bench.step()
        shares.append(float((np.abs(bench.plant.qd) / LIMITS.speed).max()))
    return max(shares)


# A torque that moves every joint is fastest on a joint without friction.
FASTEST = {0.02: 1.75, 0.3: 1.25, 1.0: 1.0}
FROZEN = [
    pytest.param(
        friction, motor, marks=[] if friction == 1.0 or motor == 2 else pytest.mark.long
    )
    for friction in FASTEST
    for motor in range(1, 7)
]


@pytest.mark.parametrize(("friction", "motor"), FROZEN)
def test_an_encoder_that_freezes_in_a_move_is_detected(friction, motor):
    bench = HoldBench(friction=friction)
    move(bench)
    freeze(bench, motor)
    assert worst_speed(bench, 0.5) < FASTEST[friction]
    assert bench.cycle.status.verdict.detail == StalledMotor(motor)
    assert bench.plant.is_idle


@pytest.mark.parametrize(("friction", "motor"), [*FROZEN, (0.02, 7), (1.0, 7)])
def test_an_encoder_frozen_before_a_move_is_detected(friction, motor):
    bench = HoldBench(friction=friction)
    freeze(bench, motor)
    bench.cycle.move_to((bench.plant.q + OFFSETS).tolist(), SPEED)
    assert worst_speed(bench, 2.0) < FASTEST[friction]
    assert bench.cycle.status.verdict.fault is Fault.MOTOR_STALLED


@pytest.mark.parametrize(
    ("friction", "error"),
    [
        (0.02, -0.3),
        (1.0, 0.3),
        *(
            pytest.param(*case, marks=pytest.mark.long)
            for case in ((0.02, 0.3), (0.3, -0.3), (0.3, 0.3), (1.0, -0.3))
        ),
    ],
)
def test_a_sound_arm_completes_moves_with_any_friction_and_weight(friction, error):
    bench = HoldBench(friction=friction, error=error)
    begin = bench.plant.q.copy()
    for goal, speed in (
        (OFFSETS, 0.5),
        (0.0 * OFFSETS, 0.05),
        (0.1 * OFFSETS, 0.05),
        (0.0, 0.5),
    ):
        bench.cycle.move_to((begin + goal).tolist(), speed)
        bench.run(np.abs(OFFSETS).max() / speed + 1.5 if speed > 0.1 else 3.0)
        assert bench.cycle.status.verdict is None


def test_joint_7_frozen_at_its_top_speed_is_braked():
    bench = HoldBench()
    bench.cycle.move_to((bench.plant.q + OFFSETS).tolist(), SPEED)
    bench.run(0.8)
    assert bench.plant.qd[6] == pytest.approx(SPEED, rel=0.1)
    freeze(bench, 7)
    assert worst_speed(bench, 0.5) < 1.0
    assert bench.cycle.status.verdict.detail == StalledMotor(7)


def test_holding_the_arm_in_a_move_brakes_it():
    """A held motor cannot be distinguished from a stuck one."""
    bench = HoldBench()
    move(bench)
    q = bench.plant.q.copy()
    for _ in range(50):
        bench.plant.qd[:] = 0.0
        bench.plant.q[:] = q
        bench.step()
    assert bench.cycle.status.verdict.fault is Fault.MOTOR_STALLED
