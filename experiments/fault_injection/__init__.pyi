from .host_faults import HostFaults
from .plan import FaultTrigger, PlannedFaults, plan_faults

__all__ = [
    "FaultTrigger",
    "HostFaults",
    "PlannedFaults",
    "plan_faults",
]
