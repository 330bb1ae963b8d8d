from .database import load, to_text
from .evidence import Exclusion
from .export import break_away_batch, break_away_of, database_of
from .identify import KEPT_PER_SECOND, Confusion, Identification, identify_study
from .known import KnownTerrain, TerrainDatabase
from .parts import foresight_in
from .table import SlipRisk, TractionEstimate, TractionEstimates
from .verdict import Recognition, WindowEvidence, recognise

__all__ = [
    "KEPT_PER_SECOND",
    "Confusion",
    "Exclusion",
    "Identification",
    "KnownTerrain",
    "Recognition",
    "SlipRisk",
    "TerrainDatabase",
    "TractionEstimate",
    "TractionEstimates",
    "WindowEvidence",
    "break_away_batch",
    "break_away_of",
    "database_of",
    "foresight_in",
    "identify_study",
    "load",
    "recognise",
    "to_text",
]
