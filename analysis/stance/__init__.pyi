from .outcomes import (
    FRESH_SCALE,
    StanceOutcome,
    StanceTotals,
    StanceWatch,
    adapted,
    totals,
    wilson,
)
from .policies import POLICIES, avoid_slip, constant_mu, no_policy, oracle, planned
from .seam import (
    BEGIN,
    StanceCommand,
    StanceForesight,
    StancePhase,
    StancePolicy,
    StanceRequest,
    StanceSample,
    risk_tables,
)
from .sequence import LEAST_TRAVEL, SoleView, StancePlan, StanceSequence

__all__ = [
    "BEGIN",
    "FRESH_SCALE",
    "LEAST_TRAVEL",
    "POLICIES",
    "SoleView",
    "StanceCommand",
    "StanceForesight",
    "StanceOutcome",
    "StancePhase",
    "StancePlan",
    "StancePolicy",
    "StanceRequest",
    "StanceSample",
    "StanceSequence",
    "StanceTotals",
    "StanceWatch",
    "adapted",
    "avoid_slip",
    "constant_mu",
    "no_policy",
    "oracle",
    "planned",
    "risk_tables",
    "totals",
    "wilson",
]
