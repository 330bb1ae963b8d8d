from .choices import AnalysisChoices, analysis_choices, repeat_study
from .export import export_sessions
from .playback import play
from .progress import fitting
from .sessions import (
    REPORTED,
    ReportRequest,
    choose_sessions,
    export_terrains,
    report_sessions,
    require_samples,
    tell_missing,
)
from .truth_errors import compare_with_truth, z_scores

__all__ = [
    "REPORTED",
    "AnalysisChoices",
    "ReportRequest",
    "analysis_choices",
    "choose_sessions",
    "compare_with_truth",
    "export_sessions",
    "export_terrains",
    "fitting",
    "play",
    "repeat_study",
    "report_sessions",
    "require_samples",
    "tell_missing",
    "z_scores",
]
