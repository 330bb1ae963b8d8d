"""A requested move reaches the controller once and bounded; so does a report."""

import numpy as np
import pytest

from acquisition.control_loop.faults import Fault, verdict_for
from acquisition.control_loop.states import ArmState
from tests.acquisition.control_loop.test_cycle import Bench, Law
from tests.wam.control.test_controller import DOWN, reading
from wam.control.controller import FootController
from wam.control.position_control import BREAKAWAY, JointMove
from wam.control.soft_walls import SoftWalls, Walls

GOAL = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
LIMITS = (2.0, 4.5, 1.5, 1.5, 0.25, 0.25, 0.13)  # N m, far below the arm's weight


class MovingLaw(Law):
    """Records the moves that it is given."""

    def __init__(self):
        super().__init__()
        self.moves = []
        self.is_refusing = False

    def move_to(self, goal, speed, reading):
        if self.is_refusing:
            raise ValueError
        self.moves.append((goal.tolist(), speed))


@pytest.fixture
def bench():
    bench = Bench()
    bench.law = MovingLaw()
    bench.cycle = bench.make()
    bench.enter(ArmState.HOLD)
    return bench


def test_a_move_is_passed_to_the_controller_once(bench):
    bench.cycle.move_to(GOAL, 0.4)
    bench.run(3)
    assert bench.law.moves == [(list(GOAL), 0.4)]


def test_a_move_waits_for_a_complete_reading(bench):
    bench.cycle.move_to(GOAL, 0.4)
    bench.arm.missing = 1
    bench.run()
    assert bench.law.moves == []
    bench.arm.missing = 0
    bench.run()
    assert len(bench.law.moves) == 1


def test_a_move_refused_by_the_controller_is_a_fault(bench):
    bench.law.is_refusing = True
    bench.cycle.move_to(GOAL, 0.4)
    bench.run(2)
    assert bench.reason == Fault.MOVE_REFUSED


def test_an_external_report_counts_if_the_guard_passes(bench):
    bench.cycle.report(verdict_for(Fault.CONSOLE_SILENT))
    bench.run()
    assert bench.reason == Fault.CONSOLE_SILENT


def test_an_external_report_hides_no_worse_fault(bench):
    bench.cycle.report(verdict_for(Fault.CONSOLE_SILENT))
    bench.arm.qd = np.full(7, 9.0)
    bench.run()
    assert bench.reason == Fault.HOLD_MOTION
    assert bench.state is ArmState.IDLE


def test_a_report_is_obeyed_once(bench):
    bench.cycle.report(verdict_for(Fault.CONSOLE_SILENT))
    bench.run()
    bench.enter(ArmState.FLOAT)
    bench.run(3)
    assert (bench.state, bench.reason) == (ArmState.FLOAT, "")


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_move_keeps_a_margin_to_the_torque_limits(foot_model, side):
    constants = foot_model.constants
    walls = SoftWalls(
        Walls(tuple(constants.q_lower), tuple(constants.q_upper), LIMITS, (0.0,) * 7)
    )
    law = FootController(foot_model, 0.0, walls=walls)
    law.enter(ArmState.HOLD, reading(0.0))
    law.move_to(DOWN + 0.1 * side, 0.5, reading(0.0))
    tau, _ = law.torque(reading(60.0, q=DOWN - 0.3 * side))  # held back
    assert (np.abs(tau) <= 0.9 * np.array(LIMITS) + 1e-12).all()
    used = np.abs(tau) / np.array(LIMITS)
    assert (used > 0.899).sum() >= 6  # the weight of joint 2 reduces its torque


def test_a_move_under_way_gets_gravity_torque_only(foot_model):
    """An arm on its reference in position and speed gets no torque of the PD."""
    law = FootController(foot_model, 0.0)
    law.enter(ArmState.HOLD, reading(0.0))
    goal = DOWN.copy()
    goal[1] += 0.4
    duration = law.move_to(goal, 0.5, reading(0.0))
    move = JointMove(DOWN, goal, 0.5)
    for share in (0.3, 0.5, 0.9):
        q, qd = move.at(share * duration)
        tau, gravity = law.torque(reading(share * duration, q=q, qd=qd))
        assert tau[:6] == pytest.approx(gravity[:6], abs=1e-3)


STRETCHED = np.array([0.0, 1.2, 0.0, 0.5, 0.0, 0.0, 0.2])


@pytest.mark.parametrize("offset", [-0.4, 0.4])
def test_gravity_torque_alone_does_not_flag_a_motor(foot_model, offset):
    """On its reference only its weight pulls the arm, and that is compensated."""
    law = FootController(foot_model, 0.0)
    law.enter(ArmState.HOLD, reading(0.0, q=STRETCHED))
    goal = STRETCHED.copy()
    goal[1] += offset
    duration = law.move_to(goal, 0.5, reading(0.0, q=STRETCHED))
    for share in (0.0, 0.3, 0.5, 0.9):
        q, qd = JointMove(STRETCHED, goal, 0.5).at(share * duration)
        _, gravity = law.torque(reading(share * duration, q=q, qd=qd))
        assert abs(gravity[1]) > BREAKAWAY[1]  # it would move the joint
        assert law.stuck_motor() == 0


@pytest.mark.parametrize("offset", [-0.4, 0.4])
def test_a_joint_pulled_by_a_move_beyond_its_weight_is_detected(foot_model, offset):
    """Up and down, as soon as the pull exceeds any breakaway torque."""
    law = FootController(foot_model, 0.0)
    law.enter(ArmState.HOLD, reading(0.0, q=STRETCHED))
    goal = STRETCHED.copy()
    goal[1] += offset
    law.move_to(goal, 0.5, reading(0.0, q=STRETCHED))
    bound = np.abs(np.linalg.inv(foot_model.constants.j2mp).T) @ BREAKAWAY
    for seconds in np.arange(0.0, 0.4, 0.002):
        tau, gravity = law.torque(reading(seconds, q=STRETCHED))
        pulls = np.abs(np.linalg.solve(foot_model.constants.j2mp.T, tau - gravity))
        assert (law.stuck_motor() in {2, 3}) == (pulls > bound)[1:3].any()
    assert law.stuck_motor() in {2, 3}


def test_a_move_does_not_flag_a_motor_for_an_earlier_move(foot_model):
    """The move begins with the torque of a hold that a person pushes against."""
    law = FootController(foot_model, 0.0)
    law.enter(ArmState.HOLD, reading(0.0))
    goal = DOWN.copy()
    goal[3] += 0.4
    law.move_to(goal, 0.5, reading(0.0))
    law.torque(reading(0.0))
    law.enter(ArmState.HOLD, reading(9.0, q=goal))
    pushed = reading(10.0, q=goal - 0.1 * np.eye(7)[3])
    tau, gravity = law.torque(pushed)
    assert tau[3] - gravity[3] > BREAKAWAY[3]
    law.move_to(goal, 0.5, pushed)
    law.torque(pushed)
    assert law.stuck_motor() == 0


@pytest.mark.parametrize("stop", ["q_lower", "q_upper"])
def test_a_move_may_end_at_a_joint_stop_but_not_beyond(foot_model, stop):
    law = FootController(foot_model, 0.0)
    law.enter(ArmState.HOLD, reading(0.0))
    goal = DOWN.copy()
    goal[3] = getattr(foot_model.constants, stop)[3]
    assert law.move_to(goal, 0.5, reading(0.0)) > 0.0
    goal[3] *= 1.01
    with pytest.raises(ValueError, match="stops"):
        law.move_to(goal, 0.5, reading(0.0))


def test_no_move_begins_while_a_verdict_is_active(bench):
    bench.cycle.report(verdict_for(Fault.CONSOLE_SILENT))
    bench.run()
    bench.cycle.move_to(GOAL, 0.4)
    bench.run(2)
    bench.enter(ArmState.HOLD)
    bench.run(2)
    assert bench.law.moves == []
    bench.cycle.move_to(GOAL, 0.4)
    bench.run()
    assert len(bench.law.moves) == 1
