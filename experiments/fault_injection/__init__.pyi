from .host_faults import COMPUTER_FAULTS, HostFaults
from .plan import FaultTrigger, PlannedFaults, plan_faults

__all__ = [
    "COMPUTER_FAULTS",
    "FaultTrigger",
    "HostFaults",
    "PlannedFaults",
    "plan_faults",
]
