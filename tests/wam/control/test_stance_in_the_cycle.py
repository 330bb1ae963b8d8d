"""A foot that stands by itself: in hold only, ended by every state, bounded."""

import math
from dataclasses import replace

import numpy as np
import pytest

from acquisition.control_loop.faults import Fault, verdict_for
from acquisition.control_loop.law import SoleGoal
from acquisition.control_loop.proof import ProofGoal, ProofKind
from acquisition.control_loop.states import ArmState
from acquisition.devices import PositionJump
from tests.acquisition.control_loop.test_cycle import Bench, Law
from tests.wam.control.test_controller import DOWN, reading
from wam.control.controller import FootController
from wam.control.soft_walls import SoftWalls, Walls
from wam.control.sole_impedance import SoleImpedance
from wam.model.arm_model import ArmModel

PRESS = SoleGoal(2.0, 10.0, 0.0, 0.0, 0.0)
LIMITS = (50.0, 60.0, 30.0, 30.0, 8.0, 8.0, 1.3)  # N m


class StandingLaw(Law):
    """Keeps the goals that it is given."""

    def __init__(self):
        super().__init__()
        self.goals = []
        self.is_refusing = False

    def stand(self, goal, reading):
        if self.is_refusing:
            raise ValueError
        self.goals.append(goal)


@pytest.fixture
def bench():
    bench = Bench()
    bench.law = StandingLaw()
    bench.cycle = bench.make()
    bench.enter(ArmState.HOLD)
    return bench


def test_a_goal_reaches_the_law_once(bench):
    bench.cycle.stand(PRESS)
    bench.run(3)
    assert bench.law.goals == [PRESS]


def test_a_goal_that_the_law_refuses_is_a_fault(bench):
    bench.law.is_refusing = True
    bench.cycle.stand(PRESS)
    bench.run(2)
    assert bench.reason == Fault.MOVE_REFUSED


def test_after_a_verdict_no_goal_reaches_the_law(bench):
    bench.cycle.report(verdict_for(Fault.CONSOLE_SILENT))
    bench.run()
    bench.cycle.stand(PRESS)
    bench.run()
    assert bench.law.goals == []


def controller(model: ArmModel, *, can_stand=True) -> FootController:
    constants = model.constants
    walls = Walls(
        lower=tuple(constants.q_lower.tolist()),
        upper=tuple(constants.q_upper.tolist()),
        torque=LIMITS,
        damping=tuple(constants.kd.tolist()),
    )
    law = FootController(model, 0.3, walls=SoftWalls(walls))
    if can_stand:
        position, _ = model.sole_pose(DOWN)
        law.impedance = SoleImpedance(model, np.eye(3), position, 0.4, 0.002)
    law.enter(ArmState.HOLD, reading(0.0))
    return law


def test_a_controller_without_impedance_lets_nothing_stand(foot_model):
    with pytest.raises(ValueError, match="does not stand"):
        controller(foot_model, can_stand=False).stand(PRESS, reading(0.0))


@pytest.mark.parametrize("state", [ArmState.FLOAT, ArmState.GUIDE, ArmState.DAMP])
def test_a_foot_stands_in_hold_only(state, foot_model):
    law = controller(foot_model)
    law.enter(state, reading(0.0))
    with pytest.raises(ValueError, match="hold only"):
        law.stand(PRESS, reading(0.0))


def test_a_refused_goal_begins_no_stance(foot_model):
    law = controller(foot_model)
    with pytest.raises(ValueError, match="bounds"):
        law.stand(SoleGoal(99.0, 10.0, 0.0, 0.0, 0.0), reading(0.0))
    assert not law.is_moving()


@pytest.mark.parametrize("state", list(ArmState))
def test_every_state_ends_a_stance(state, foot_model):
    law = controller(foot_model)
    law.stand(PRESS, reading(0.0))
    assert law.is_moving()
    law.enter(state, reading(0.0))
    assert not law.is_moving()


def test_the_torques_of_a_stance_are_the_jacobian_of_its_force(foot_model):
    law = controller(foot_model)
    model = foot_model
    for k in range(200):
        now = reading(k * 0.002)
        if k % 10 == 0:
            law.stand(PRESS, now)
        tau, gravity = law.torque(now)
    force = np.array([2.0, 0.0, -10.0, 0.0, 0.0, 0.0])
    wanted = model.sole_jacobian(DOWN).T @ force
    np.testing.assert_allclose((tau - gravity)[:6], wanted[:6], atol=1e-6)
    assert math.isfinite(float(tau[6]))


def test_a_false_position_pushes_nothing(foot_model):
    law = controller(foot_model)
    for k in range(100):
        law.stand(PRESS, reading(k * 0.002))
        law.torque(reading(k * 0.002))
    jump = PositionJump(motor=7, counts=400, speed=12.0)
    false = replace(reading(0.2), jump=jump)
    tau, gravity = law.torque(false)
    np.testing.assert_array_equal(tau, gravity)


@pytest.mark.parametrize("turned", [-0.05, 0.05])
def test_a_sole_that_turns_is_turned_back(turned, foot_model):
    law = controller(foot_model)
    law.stand(SoleGoal(0.0, 0.0, 0.0, 0.0, 0.0), reading(0.0))
    q = DOWN.copy()
    q[5] += turned
    tau, gravity = law.torque(reading(0.002, q=q))

    assert (tau - gravity)[5] * turned < 0.0
    assert abs((tau - gravity)[5]) > 0.3  # 12 N m/rad, and the way of the sole


def test_a_sole_aside_of_the_centre_line_is_drawn_back(foot_model):
    law = controller(foot_model)
    law.stand(SoleGoal(0.0, 0.0, 0.0, 0.0, 0.0), reading(0.0))
    q = DOWN.copy()
    q[0] += 0.02
    tau, gravity = law.torque(reading(0.002, q=q))

    assert (tau - gravity)[0] < -0.5


def test_a_proof_goes_beyond_a_limit_that_counts_again_once_well_inside(bench):
    """An arm that is laid onto its stops may stand beyond the limits of positions."""
    at_limit, beyond = np.zeros(7), np.zeros(7)
    at_limit[0], beyond[0] = 1.95, 2.05
    bench.law.prove = lambda proof, reading: None
    bench.run(5)
    bench.arm.q = at_limit
    bench.cycle.prove(ProofGoal(ProofKind.RAMP, 1, 0.5, 2.0))
    bench.run()
    bench.arm.q = beyond
    bench.run(5)
    assert bench.reason == ""
    bench.arm.q = np.zeros(7)
    bench.run(5)
    bench.arm.q = beyond
    bench.run(5)
    assert bench.reason == Fault.JOINT_LIMIT
