"""An active simulated arm in the loop, with its true joint state."""

from dataclasses import replace
from weakref import finalize

import numpy as np

from acquisition.control_loop.cycle import Cycle, CycleOutputs
from acquisition.control_loop.loop import Loop
from acquisition.control_loop.states import ArmState
from fakes.clock import SteppedClock
from fakes.ground.terrain import GroundChoice
from fakes.plant.model import PlantOptions
from fakes.world.rig import FakeRig, SimulatedScene
from tests.acquisition.control_loop.limits import guard_limits
from tests.fakes.scenes import CONSTANTS, FRAME, START_Q, TOOL
from wam.bus.link import CanLink
from wam.bus.transports import PythonCanTransport
from wam.control.controller import FootController
from wam.control.soft_walls import SoftWalls, Walls
from wam.driver.arm import WamArm
from wam.driver.settings import ArmSettings
from wam.model.arm_model import ArmModel
from wam.model.constants import Body

SPEED = ArmSettings().speed_limits
TORQUE = (20.0, 45.0, 15.0, 15.0, 2.5, 2.5, 1.3)
LIMITS = guard_limits(
    q_lower=tuple(CONSTANTS.q_lower.tolist()),
    q_upper=tuple(CONSTANTS.q_upper.tolist()),
    speed=SPEED,
    torque=TORQUE,
)
RATE = 500


class NoSensor:
    def poll(self, now_ns):
        return []


class NoFoot:
    def observe(self, reading, wrench, sample):
        return 0.0


def heavier(kg):
    """Return the model of an arm whose foot is `kg` heavier than the real one."""
    foot = TOOL.foot
    return ArmModel(
        CONSTANTS, replace(TOOL, foot=Body(foot.mass + kg, foot.com, foot.inertia))
    )


class HoldBench:
    """An arm in hold without a hand on it.

    `error`: by how much rig.toml makes the foot too heavy [kg]. `compensation`: of
    friction, in the law. `motors`: friction of the motors, given instead of drawn.
    `late`: cycles by which torques arrive late. `cables`: their resonance [Hz], None =
    stiff. `mass`: virtual, in float [kg]. `sent`: the torques without gravity's
    [N m], cycle by cycle.
    """

    def __init__(
        self,
        *,
        friction=0.02,
        error=0.0,
        compensation=None,
        motors=None,
        late=0,
        cables=None,
        mass=0.0,
    ):
        self.clock = SteppedClock()
        scene = SimulatedScene("S0", GroundChoice("small", "tread"), FRAME, START_Q, 1)
        options = PlantOptions(friction, motors=motors, cables=cables)
        self.rig = FakeRig(scene, CONSTANTS, TOOL, self.clock, options)
        self.clock.attach(self.rig)
        finalize(self, self.rig.bus.shutdown)
        self.plant = self.rig.plant
        self.plant.terrain = None
        self.plant.hand.let_go()
        self.braked_q = self.plant.q.copy()
        self.arm = WamArm(
            CanLink(PythonCanTransport(self.rig.bus, self.clock)), self.clock
        )
        self.arm.start()
        self.sent = []
        usual = self.arm.send

        waiting = []

        def send(tau, tau_gravity):
            waiting.append((tau.copy(), tau_gravity))
            sent = usual(*waiting[0])
            if len(waiting) > late:
                waiting.pop(0)
            self.sent.append(sent - tau_gravity)
            return sent

        self.arm.send = send
        kd = tuple(CONSTANTS.kd.tolist())
        walls = Walls(tuple(LIMITS.q_lower), tuple(LIMITS.q_upper), TORQUE, kd)
        self.law = FootController(
            heavier(error), mass, walls=SoftWalls(walls), friction=compensation
        )
        outputs = CycleOutputs(lambda payload: None, lambda samples: None)
        self.cycle = Cycle(self.arm, NoSensor(), self.law, NoFoot(), LIMITS, outputs)
        self.loop = Loop(self.cycle, self.clock)
        self.run(0.01)
        self.cycle.start()
        self.run(0.002)
        self.run(0.04)
        self.rig.network.pendant("activate")
        self.run(0.1)

    def enter(self, state):
        self.cycle.request(state)
        self.run(0.002)

    def run(self, seconds):
        """Let time pass; return the true positions of every cycle, shape (n, 7)."""
        return np.array([self.step() for _ in range(round(seconds * RATE))])

    def step(self):
        self.loop.step()
        return self.plant.q.copy()

    def throw(self, joint, speed):
        """Bring a floating arm's joint to `speed` [rad/s] within 0.12 s."""
        self.enter(ArmState.FLOAT)
        for cycle in range(60):
            self.plant.qd[joint] = speed * (cycle + 1) / 60
            self.step()

    def push(self, joint, torque, seconds):
        """Push a joint with `torque` [N m]; return the true positions."""
        self.plant.disturbance[joint] = torque
        q = self.run(seconds)
        self.plant.disturbance[joint] = 0.0
        return q
