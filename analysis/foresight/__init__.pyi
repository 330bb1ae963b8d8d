from .curves import ForesightCurves, ForesightExcerpt, foresight_curves
from .engine import (
    Foresight,
    ForesightFlag,
    ForesightState,
    RiskTable,
)
from .ground import GroundLaw, GroundModel, GroundRecogniser
from .held_out import LearningTasks, folds_of, foresee, hold_out, learn
from .judged import (
    JUDGED_TYPES,
    SLID,
    JudgedForesight,
    JudgedTask,
    WatchedSource,
    digest_of,
    judge,
    plan_judged,
)
from .logistic import RidgeLogistic, all_pairs, fit_logistic
from .model import ForesightModel, Provenance, RigIdentity, SlipModel
from .scores import (
    GroundAnswers,
    GroundScore,
    SlipScore,
    ground_answers,
    score_ground,
    score_slips,
)
from .signals import EVERY, FEATURES, LAGS, FootSample, Signals
from .ticks import ForesightRun
from .training import fit_foresight, fit_ground
from .watching import (
    FLAT_SURFACE,
    HORIZON,
    ROCKY_SURFACE,
    WatchedTrial,
    WatchTask,
    watch,
    watch_all,
    watch_file,
    watch_series,
)
from .whole_record import FootRecord

__all__ = [
    "EVERY",
    "FEATURES",
    "FLAT_SURFACE",
    "HORIZON",
    "JUDGED_TYPES",
    "LAGS",
    "ROCKY_SURFACE",
    "SLID",
    "FootRecord",
    "FootSample",
    "Foresight",
    "ForesightCurves",
    "ForesightExcerpt",
    "ForesightFlag",
    "ForesightModel",
    "ForesightRun",
    "ForesightState",
    "GroundAnswers",
    "GroundLaw",
    "GroundModel",
    "GroundRecogniser",
    "GroundScore",
    "JudgedForesight",
    "JudgedTask",
    "LearningTasks",
    "Provenance",
    "RidgeLogistic",
    "RigIdentity",
    "RiskTable",
    "Signals",
    "SlipModel",
    "SlipScore",
    "WatchTask",
    "WatchedSource",
    "WatchedTrial",
    "all_pairs",
    "digest_of",
    "fit_foresight",
    "fit_ground",
    "fit_logistic",
    "folds_of",
    "foresee",
    "foresight_curves",
    "ground_answers",
    "hold_out",
    "judge",
    "learn",
    "plan_judged",
    "score_ground",
    "score_slips",
    "watch",
    "watch_all",
    "watch_file",
    "watch_series",
]
