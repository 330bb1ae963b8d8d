"""Driver, control law and plant, joined by the bus only, judged by the truth."""

import numpy as np
import pytest

from acquisition.control_loop.states import ArmState
from fakes.clock import SteppedClock
from fakes.ground.terrain import GroundChoice
from fakes.plant.model import PlantOptions
from fakes.world.rig import FakeRig, SimulatedScene, solve_start
from ft_sensor.payload import TerrainFrame
from wam.bus.link import CanLink
from wam.bus.transports import PythonCanTransport
from wam.control.controller import FootController
from wam.driver.arm import WamArm
from wam.driver.settings import ArmSettings
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants

CONSTANTS = load_constants()
PERIOD_NS = 2_000_000
FRAME = TerrainFrame(0.0, 0.0, (0.70, 0.0, 0.12), 0.45)
START = np.array([0.0, 0.7696, 0.0, 1.1857, 0.0, 1.1863, 0.0])
POSES = [
    START,
    np.array([0.0, 0.9, 0.0, 1.6, 0.0, np.pi - 2.5, 0.0]),
    np.array([0.0, -1.5708, 0.0, 1.5708, 0.0, 0.0, 0.0]),
    np.array([0.35, -0.8, 0.6, 1.7, -1.1, 0.5, 1.9]),
    np.array([-1.2, 1.1, -1.4, 2.3, 0.7, -0.9, -2.1]),
    np.array([0.5, 0.3, -0.4, 2.0, 0.3, 0.6, 0.2]),
]


class ClosedLoop:
    """An arm that a control law moves through the simulated bus, without a hand."""

    def __init__(self, tool, q, friction=0.05, virtual_mass=0.0):
        self.clock = SteppedClock()
        scene = SimulatedScene(
            "TF", GroundChoice("none", "tread"), FRAME, START, seed=1
        )
        options = PlantOptions(friction=friction)
        self.rig = FakeRig(scene, CONSTANTS, tool, self.clock, options)
        self.rig.plant.q = q.copy()
        self.rig.plant.hand.let_go()
        self.ground = self.rig.plant.terrain
        self.rig.plant.terrain = None  # the poses reach below the plate
        self.clock.attach(self.rig)
        self.model = ArmModel(CONSTANTS, tool)
        self.law = FootController(self.model, virtual_mass)
        self.arm = WamArm(
            CanLink(PythonCanTransport(self.rig.bus, self.clock)),
            self.clock,
            ArmSettings(j2mp=CONSTANTS.j2mp),
        )
        self.arm.start()

    def start(self, state):
        self.step(5)
        self.law.enter(state, self.reading)
        self.step(2, is_commanded=True)
        self.rig.network.pendant("activate")

    def step(self, cycles, *, is_commanded=False):
        for _ in range(cycles):
            self.clock.sleep_until(
                self.clock.now_ns() // PERIOD_NS * PERIOD_NS + PERIOD_NS
            )
            self.reading = self.arm.read(self.clock.now_ns())
            tau, gravity = np.zeros(7), np.zeros(7)
            if is_commanded:
                tau, gravity = self.law.torque(self.reading)
            self.arm.send(tau, gravity)

    def close(self):
        self.arm.idle()
        self.arm.close()

    @property
    def sole(self):
        return self.model.sole_pose(self.rig.plant.q)[0]


@pytest.fixture
def build(example_tool):
    loops = []

    def build_one(*args, **kwargs):
        loops.append(ClosedLoop(example_tool, *args, **kwargs))
        return loops[-1]

    yield build_one
    for loop in loops:
        loop.close()


@pytest.mark.slow
@pytest.mark.parametrize("pose", range(len(POSES)))
def test_the_arm_stays_where_it_is_held(build, pose):
    loop = build(POSES[pose])
    loop.start(ArmState.HOLD)
    before = loop.sole
    loop.step(2500, is_commanded=True)  # 5 s
    assert np.linalg.norm(loop.sole - before) < 0.002


def test_the_arm_sags_without_compensation(build):
    loop = build(POSES[0])
    loop.start(ArmState.HOLD)
    before = loop.sole
    loop.step(150)  # 0.3 s with zero torque
    assert loop.sole[2] < before[2] - 0.05


@pytest.mark.slow
def test_the_foot_presses_with_the_weight_of_the_virtual_mass(build):
    mass = 0.3
    loop = build(START, friction=0.0, virtual_mass=mass)
    q = solve_start(loop.model, FRAME, START, 0.001)
    loop.rig.plant.q = q
    loop.rig.plant.terrain = loop.ground
    loop.rig.plant.hand.carry((0.0, 0.0, 0.001))  # orientation and sides held
    loop.start(ArmState.FLOAT)
    loop.rig.plant.hand.put_down(0.0)
    loop.step(2500, is_commanded=True)
    forces = []
    for _ in range(500):
        loop.step(1, is_commanded=True)
        forces.append(loop.rig.plant.contact_force[2])
    assert np.mean(forces) == pytest.approx(mass * 9.81, abs=0.05)


def test_joint_7_deflects_within_its_limit(build):
    loop = build(POSES[0])
    loop.start(ArmState.HOLD)
    loop.step(500, is_commanded=True)
    before = loop.rig.plant.q[6]
    loop.rig.plant.disturbance[6] = 10.0 * 0.020  # 10 N at 20 mm off the axis
    loop.step(1000, is_commanded=True)
    moved = abs(loop.rig.plant.q[6] - before)
    assert 0.005 < moved <= 0.012


def test_the_arm_reaches_its_goal(build):
    loop = build(POSES[0])
    loop.start(ArmState.HOLD)
    loop.step(100, is_commanded=True)
    goal = loop.reading.q + np.array([0.2, -0.1, 0.1, -0.2, 0.2, -0.1, 0.2])
    duration = loop.law.move_to(goal, 0.5, loop.reading)
    fastest = 0.0
    for _ in range(round((duration + 1.0) * 500)):
        loop.step(1, is_commanded=True)
        fastest = max(fastest, float(np.abs(loop.rig.plant.qd).max()))
    assert np.abs(loop.rig.plant.q - goal).max() < 0.001
    assert fastest < 0.6  # the cap of 0.5 rad/s and a little overshoot
