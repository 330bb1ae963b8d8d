from .plain_world import simulated_rig
from .rig import FakeRig, LocalSimulation, SimulatedScene

__all__ = [
    "FakeRig",
    "LocalSimulation",
    "SimulatedScene",
    "simulated_rig",
]
