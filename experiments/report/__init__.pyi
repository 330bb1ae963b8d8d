from .checksums import changed_files
from .choices import (
    AnalysisChoices,
    analysis_choices,
    choose_sessions,
    repeat_study,
    tell_missing,
)
from .crate import is_publication
from .credits import LICENCES, parse_author
from .export import export_sessions
from .foresight import (
    ForesightReplay,
    StudyForesight,
    replay_foresight,
    study_foresight,
)
from .playback import play, serve
from .progress import fitting
from .publication import PublishRequest, publish_sessions
from .quantities import KEPT, QUANTITIES
from .rebuilding import TOLERANCE, rebuild
from .sessions import (
    REPORTED,
    ReportRequest,
    export_terrains,
    report_sessions,
    require_samples,
)
from .table_columns import Quantity, TableColumn, columns_of
from .truth_errors import compare_with_truth, z_scores

__all__ = [
    "KEPT",
    "LICENCES",
    "QUANTITIES",
    "REPORTED",
    "TOLERANCE",
    "AnalysisChoices",
    "ForesightReplay",
    "PublishRequest",
    "Quantity",
    "ReportRequest",
    "StudyForesight",
    "TableColumn",
    "analysis_choices",
    "changed_files",
    "choose_sessions",
    "columns_of",
    "compare_with_truth",
    "export_sessions",
    "export_terrains",
    "fitting",
    "is_publication",
    "parse_author",
    "play",
    "publish_sessions",
    "rebuild",
    "repeat_study",
    "replay_foresight",
    "report_sessions",
    "require_samples",
    "serve",
    "study_foresight",
    "tell_missing",
    "z_scores",
]
