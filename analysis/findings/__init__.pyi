from .findings import (
    RESIDUAL_MODELS,
    StudyResults,
    compute_results,
    findings_rows,
    plain_findings,
)
from .paper_claims import PaperClaim
from .rig_health import PERIOD_EDGES, SKEW_EDGES, RigTrial, summarise_rig
from .surfaces import Surface, common_range
from .trends import MEAN_FORCE, MEAN_LOAD, TRACTION_RATIO, Trend

__all__ = [
    "MEAN_FORCE",
    "MEAN_LOAD",
    "PERIOD_EDGES",
    "RESIDUAL_MODELS",
    "SKEW_EDGES",
    "TRACTION_RATIO",
    "PaperClaim",
    "RigTrial",
    "StudyResults",
    "Surface",
    "Trend",
    "common_range",
    "compute_results",
    "findings_rows",
    "plain_findings",
    "summarise_rig",
]
