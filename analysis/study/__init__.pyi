from .crossval import FoldResult, ModelFold, plan_folds, run_fold
from .fits import CsvRow, flag_counts, to_csv, to_fits, to_plain, tustin_medians
from .jobs import Store, Workers, available_cores, run_tasks
from .metrics import (
    PairedComparison,
    Prediction,
    adjusted_by_holm,
    compare,
    standard_error,
)
from .models import (
    FITTERS,
    GP_NN,
    GP_NN_TUSTIN,
    GP_SE,
    GP_SE_NOISE,
    GP_SE_TUSTIN,
    TITLES,
    TUSTIN,
    FitOptions,
    FittedModel,
    GpModel,
    ModelFitter,
    TustinModel,
)
from .noise_selection import NAMES
from .store import ResultStore, write_atomic
from .study import LIFTED_WARNING, Study, StudyOptions, run_study
from .terrain_fit import PooledTustinFit, TerrainResult, mean_of

__all__ = [
    "FITTERS",
    "GP_NN",
    "GP_NN_TUSTIN",
    "GP_SE",
    "GP_SE_NOISE",
    "GP_SE_TUSTIN",
    "LIFTED_WARNING",
    "NAMES",
    "TITLES",
    "TUSTIN",
    "CsvRow",
    "FitOptions",
    "FittedModel",
    "FoldResult",
    "GpModel",
    "ModelFitter",
    "ModelFold",
    "PairedComparison",
    "PooledTustinFit",
    "Prediction",
    "ResultStore",
    "Store",
    "Study",
    "StudyOptions",
    "TerrainResult",
    "TustinModel",
    "Workers",
    "adjusted_by_holm",
    "available_cores",
    "compare",
    "flag_counts",
    "mean_of",
    "plan_folds",
    "run_fold",
    "run_study",
    "run_tasks",
    "standard_error",
    "to_csv",
    "to_fits",
    "to_plain",
    "tustin_medians",
    "write_atomic",
]
