"""Arm, foot and ground of the simulations in these tests."""

import numpy as np

from fakes.clock import SteppedClock
from fakes.ground.terrain import GroundChoice
from fakes.plant.model import PlantOptions
from fakes.plant.plant import ArmPlant
from fakes.world.rig import FakeRig, SimulatedScene, solve_start
from ft_sensor.payload import TerrainFrame
from wam.model.arm_model import ArmModel
from wam.model.constants import Body, load_constants
from wam.model.gravity import compensation
from wam.model.tool import Tool, sensor_body

CONSTANTS = load_constants()
FOOT = Body(0.45, np.array([0.01, 0.0, 0.062]), np.diag([4e-4, 5.5e-4, 4.5e-4]))
TOOL = Tool(sensor_body(), FOOT, np.array([0.01, 0.0, 0.112]))
FRAME = TerrainFrame(incline=0.0, heading=0.0, start=(0.70, 0.0, 0.12), travel=0.45)
START_Q = np.array([0.0, 0.7696, 0.0, 1.1857, 0.0, 1.1863, 0.0])
MODEL = ArmModel(CONSTANTS, TOOL)
CYCLE_NS = 2_000_000


def make_plant(
    height=0.05, *, friction=0.0, substeps=4, constants=CONSTANTS, seed=None, **more
):
    """Return an idle arm on its stand, the sole `height` [m] above the far end."""
    q = solve_start(MODEL, FRAME, START_Q, height)
    options = PlantOptions(friction, substeps, seed, **more)
    return ArmPlant(constants, TOOL, FRAME, q, options)


def release(plant):
    """Let the joints follow torque."""
    plant.short_windings([False] * 7)


def send(plant, tau):
    """Send joint torques [N m] in the units of the pucks."""
    motor = np.linalg.solve(CONSTANTS.j2mp.T, tau)
    plant.set_torques((motor * np.array(CONSTANTS.ipnm)).tolist())


def float_for(plant, seconds, virtual_mass=0.0):
    """Let time pass under gravity compensation; yield after every cycle."""
    for _ in range(round(seconds * 500)):
        send(plant, compensation(MODEL, plant.q, virtual_mass))
        plant.advance(plant.t_ns + CYCLE_NS)
        yield plant


def sole(plant):
    """Return the sole in the frame of the terrain [m]."""
    position = MODEL.sole_pose(plant.q)[0]
    return FRAME.axes() @ (position - np.array(FRAME.start))


def make_rig(seed=1, terrain="S0", stones="small", network=None):
    clock = SteppedClock()
    scene = SimulatedScene(terrain, GroundChoice(stones, "tread"), FRAME, START_Q, seed)
    rig = FakeRig(scene, CONSTANTS, TOOL, clock, network=network)
    clock.attach(rig)
    return rig, clock
