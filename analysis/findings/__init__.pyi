from .break_away import RISKS, TerrainBreakAway
from .findings import (
    RESIDUAL_MODELS,
    StudyResults,
    compute_results,
    findings_rows,
    plain_findings,
)
from .force_uncertainty import (
    ForceUncertainty,
    TaredTrial,
    uncertainties_of,
    uncertainty_of,
)
from .held_trial import HeldTrial, TrialFiles
from .new_trial_bands import BINS, ORACLE, HeldOutShares
from .paper_claims import PaperClaim
from .rig_health import (
    PERIOD_EDGES,
    SKEW_EDGES,
    RigTrial,
    summarise_rig,
    with_tares,
)
from .surfaces import Surface, common_range
from .trends import MEAN_FORCE, MEAN_LOAD, TRACTION_RATIO, Trend, traction_ratio

__all__ = [
    "BINS",
    "MEAN_FORCE",
    "MEAN_LOAD",
    "ORACLE",
    "PERIOD_EDGES",
    "RESIDUAL_MODELS",
    "RISKS",
    "SKEW_EDGES",
    "TRACTION_RATIO",
    "ForceUncertainty",
    "HeldOutShares",
    "HeldTrial",
    "PaperClaim",
    "RigTrial",
    "StudyResults",
    "Surface",
    "TaredTrial",
    "TerrainBreakAway",
    "Trend",
    "TrialFiles",
    "common_range",
    "compute_results",
    "findings_rows",
    "plain_findings",
    "summarise_rig",
    "traction_ratio",
    "uncertainties_of",
    "uncertainty_of",
    "with_tares",
]
