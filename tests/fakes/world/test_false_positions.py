"""A single false position does not jerk the arm, from driver to plant."""

import numpy as np
import pytest

from acquisition.control_loop.cycle import Cycle, CycleOutputs
from acquisition.control_loop.limits import MAX_TORQUE_STEP
from acquisition.control_loop.loop import Loop
from acquisition.control_loop.states import ArmState
from tests.acquisition.control_loop.limits import guard_limits
from tests.fakes.scenes import CONSTANTS, MODEL, make_rig
from tests.sweeps import swept
from wam.bus.frames import decode_position, encode_position, position_reply_id
from wam.bus.link import CanLink
from wam.bus.transports import PythonCanTransport
from wam.control.controller import FootController
from wam.driver.arm import WamArm
from wam.driver.settings import ArmSettings

SETTINGS = ArmSettings()
# A third of the smallest speed limit; for the light joint 7 a quarter of its limit.
SPEED_BOUND = dict.fromkeys(range(1, 7), 0.5) | {7: 1.0}  # rad/s
PERIOD = 0.002
TORQUE = np.array([20.0, 45.0, 15.0, 15.0, 2.5, 2.5, 1.3])
ROUNDING = 0.02  # N m, half a puck unit at the joint
LIMITS = guard_limits(
    q_lower=CONSTANTS.q_lower,
    q_upper=CONSTANTS.q_upper,
    speed=SETTINGS.speed_limits,
    torque=TORQUE,
)


class NoSensor:
    def poll(self, now_ns):
        return []


class NoFoot:
    def observe(self, reading, wrench, sample):
        return 0.0


class Bench:
    """An active arm of which one puck can report a false position once."""

    def __init__(self, state):
        self.rig, self.clock = make_rig()
        self.rig.plant.hand.let_go()
        link = CanLink(PythonCanTransport(self.rig.bus, self.clock))
        self.arm = WamArm(link, self.clock)
        self.arm.start()
        self.lie = None  # (motor, counts)
        self.honest, link.receive = link.receive, self.receive
        self.torques, self.speeds = [], []
        usual = self.arm.send

        def send(tau, tau_gravity):
            self.torques.append(usual(tau, tau_gravity))
            return self.torques[-1]

        self.arm.send = send
        law = FootController(MODEL, 0.0)
        outputs = CycleOutputs(lambda payload: None, lambda samples: None)
        self.cycle = Cycle(self.arm, NoSensor(), law, NoFoot(), LIMITS, outputs)
        self.loop = Loop(self.cycle, self.clock)
        self.run(5)
        self.cycle.start()
        self.run(20)
        self.rig.network.pendant("activate")
        self.run(20)
        self.cycle.request(state)
        self.run(20)

    def receive(self):
        frames = self.honest()
        if self.lie is None:
            return frames
        motor, counts = self.lie
        wanted = position_reply_id(motor)
        received = []
        for frame in frames:
            if frame.can_id == wanted and self.lie is not None:
                self.lie = None
                data = encode_position(decode_position(frame.data) + counts)
                frame = frame._replace(data=data)  # noqa: PLW2901
            received.append(frame)
        return received

    def run(self, cycles):
        for _ in range(cycles):
            self.loop.step()
            self.speeds.append(float(np.abs(self.rig.plant.qd).max()))


def plausible(motor):
    """Return the largest plausible step of a motor in one cycle [counts]."""
    per_rad = 4096 / (2 * np.pi)
    fastest = np.abs(CONSTANTS.j2mp[motor - 1]) @ np.array(SETTINGS.speed_limits)
    return SETTINGS.jump_margin * fastest * per_rad * PERIOD


@pytest.mark.parametrize("state", [ArmState.FLOAT, ArmState.HOLD])
@pytest.mark.parametrize("motor", swept(range(1, 8), {2, 4, 7}))
def test_one_rejected_position_gives_no_torque_step(motor, state):
    bench = Bench(state)
    for share in (0.3, -0.6, 0.9, -1.0, 1.1, 5.0):
        bench.lie = (motor, round(share * plausible(motor)))
        bench.run(25)
        assert bench.lie is None
    sent = np.array(bench.torques)
    assert (np.abs(sent) <= TORQUE + ROUNDING).all()
    assert (
        np.abs(np.diff(sent, axis=0)) <= np.array(MAX_TORQUE_STEP) * TORQUE + ROUNDING
    ).all()
    assert max(bench.speeds) < SPEED_BOUND[motor]
    bench.arm.close()
