from .database import load, to_text
from .export import database_of
from .identify import KEPT_PER_SECOND, Confusion, Identification, identify_study
from .known import KnownTerrain, TerrainDatabase
from .recognition import Recognition, recognise
from .table import SlipRisk, TractionEstimate, TractionEstimates

__all__ = [
    "KEPT_PER_SECOND",
    "Confusion",
    "Identification",
    "KnownTerrain",
    "Recognition",
    "SlipRisk",
    "TerrainDatabase",
    "TractionEstimate",
    "TractionEstimates",
    "database_of",
    "identify_study",
    "load",
    "recognise",
    "to_text",
]
