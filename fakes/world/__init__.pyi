from .rig import FakeRig, LocalSimulation, SimulatedScene

__all__ = [
    "FakeRig",
    "LocalSimulation",
    "SimulatedScene",
]
