from .plain_world import arm_of, simulated_rig
from .rig import FakeRig, LocalSimulation, SimulatedScene

__all__ = [
    "FakeRig",
    "LocalSimulation",
    "SimulatedScene",
    "arm_of",
    "simulated_rig",
]
