from .database import TerrainDatabase, load
from .export import break_away_of, database_of
from .identify import KEPT_PER_SECOND, Confusion, Identification, identify_study
from .recognition import Recognition, recognise
from .table import SlipRisk, TractionEstimate, TractionEstimates

__all__ = [
    "KEPT_PER_SECOND",
    "Confusion",
    "Identification",
    "Recognition",
    "SlipRisk",
    "TerrainDatabase",
    "TractionEstimate",
    "TractionEstimates",
    "break_away_of",
    "database_of",
    "identify_study",
    "load",
    "recognise",
]
