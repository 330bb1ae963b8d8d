from .cycle import Cycle, CycleOutputs
from .faults import (
    Action,
    CircuitCauses,
    Fault,
    GuardVerdict,
    ReplySilence,
    from_plain,
    to_plain,
    verdict_for,
)
from .law import ControlLaw, FootObserver, SoleGoal
from .limits import GuardLimits
from .loop import Loop, LoopStats, Tick
from .realtime import Grant, RealtimeRequest, choose_cores, die_with_parent, request
from .states import ArmState, ControlStatus, transition_lines
from .timing import SLOW_EXCHANGE_NS, LoopReport, loop_report, pack_timing

__all__ = [
    "SLOW_EXCHANGE_NS",
    "Action",
    "ArmState",
    "CircuitCauses",
    "ControlLaw",
    "ControlStatus",
    "Cycle",
    "CycleOutputs",
    "Fault",
    "FootObserver",
    "Grant",
    "GuardLimits",
    "GuardVerdict",
    "Loop",
    "LoopReport",
    "LoopStats",
    "RealtimeRequest",
    "ReplySilence",
    "SoleGoal",
    "Tick",
    "choose_cores",
    "die_with_parent",
    "from_plain",
    "loop_report",
    "pack_timing",
    "request",
    "to_plain",
    "transition_lines",
    "verdict_for",
]
