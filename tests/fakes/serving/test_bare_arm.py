"""A client that knows only the CAN protocol and a gravity model moves a served arm."""

from contextlib import closing

import numpy as np
import pytest

from fakes.bus.client import SocketBus
from fakes.bus.hub import SocketHub
from fakes.serving.home_arm import HomePose, build_home_server
from tests.fakes.buses import LimitedClock
from tests.fakes.scenes import CONSTANTS, FRAME, TOOL
from tests.fakes.strict_client import (
    HOME,
    HOME_Q,
    StrictClient,
    holding_torques,
    joints,
    motor_units,
)
from wam.model.arm_model import ArmModel

WANTED = (0.2, 0.2, 0.2, -0.2, 0.0, 0.0, 0.0)
TARGET = [a + b for a, b in zip(HOME_Q, WANTED, strict=True)]
MOVE_SECONDS = 1.5
POSITION_TOLERANCE = 5e-3  # rad


class ServedArm:
    """An arm served on a socket in stepped time: stalls cost no simulated time."""

    def __init__(self, folder, *, tool=None, has_hand=False, **pose_options):
        self.clock = LimitedClock()
        pose = HomePose(tool, FRAME, None, True, has_hand, **pose_options)
        self.server = build_home_server(SocketHub(folder / "bus"), pose, self.clock)
        self.bus = SocketBus(str(folder / "bus"))
        self.client = StrictClient(self.bus, self.rest, has_sensor=tool is not None)

    def rest(self, duration_ns):
        self.clock.limit_ns = self.clock.t_ns + duration_ns
        self.server.step()
        while self.clock.t_ns < self.clock.limit_ns:
            self.server.step()

    def activate(self):
        self.client.start()
        self.server.press("activate")
        self.client.expect_active()

    def close(self):
        self.bus.shutdown()
        self.server.close()


@pytest.fixture
def serve(tmp_path):
    opened = []

    def start(**options):
        opened.append(closing(ServedArm(tmp_path, **options)))
        return opened[-1].thing

    yield start
    for arm in opened:
        arm.__exit__(None, None, None)


@pytest.mark.slow
def test_four_joints_reach_their_goal_under_vendor_control(serve):
    arm = serve()
    arm.activate()
    q = arm.client.move(WANTED, MOVE_SECONDS)
    assert q[:4] == pytest.approx(TARGET[:4], abs=POSITION_TOLERANCE)
    assert arm.server.state == "active"
    arm.client.finish()


@pytest.mark.slow
def test_a_person_carrying_the_foot_blocks_the_arm(serve):
    arm = serve(tool=TOOL, has_hand=True)
    arm.activate()
    q = arm.client.move(WANTED, MOVE_SECONDS)
    assert np.abs(np.subtract(q, TARGET)[:4]).max() > POSITION_TOLERANCE


def test_an_unsupported_bare_arm_falls(serve):
    arm = serve()
    arm.activate()
    start = arm.client.move(WANTED, MOVE_SECONDS)
    arm.client.run(cycles=100)  # sends zero torque
    q = arm.client.read_joints()
    assert np.abs(np.subtract(q, start)).max() > 0.02


def test_a_bare_arm_rests_at_home_until_it_is_activated(serve):
    arm = serve()
    arm.client.start()
    arm.client.run(cycles=100)
    assert arm.client.read_joints() == pytest.approx(HOME_Q, abs=1e-3)


def test_a_bare_arm_that_was_active_sinks_when_it_is_idle_again(serve):
    arm = serve()
    arm.activate()
    start = arm.client.move(WANTED, MOVE_SECONDS)
    arm.server.press("idle")
    arm.client.run(cycles=250)
    q = arm.client.read_joints()
    assert np.abs(np.subtract(q, start)).max() > 0.02


@pytest.mark.parametrize("seed", range(5))
def test_gravity_torques_agree_with_the_vendor(seed):
    rng = np.random.default_rng(seed)
    q = rng.uniform(CONSTANTS.q_lower, CONSTANTS.q_upper)
    expected = ArmModel(CONSTANTS).gravity(q)
    assert holding_torques(q.tolist()) == pytest.approx(expected, abs=0.01)


def test_gear_ratios_and_torque_units_agree_with_the_vendor():
    assert joints(HOME) == pytest.approx(HOME_Q, abs=1e-3)
    # Example of the protocol specification, rounded down.
    units = motor_units([1.0, -15.0, 2.0, 5.0, 0.3, -0.2, 0.05])
    assert units == [-65, -878, 556, -750, 167, 33, -59]
