from .installation import check_packages
from .loading import load_session, load_tables, load_trial
from .models import Comparison, Model, ModelScore, compare, fit, load_terrains
from .trial_sets import TrialSet
from .trials import Trial

__version__: str

__all__ = [
    "Comparison",
    "Model",
    "ModelScore",
    "Trial",
    "TrialSet",
    "check_packages",
    "compare",
    "fit",
    "load_session",
    "load_tables",
    "load_terrains",
    "load_trial",
]
