from .bands import Band, BandResult, hold_against_bands
from .model_measures import measure_models
from .slip_measures import GroundTrials, measure_slips

__all__ = [
    "Band",
    "BandResult",
    "GroundTrials",
    "hold_against_bands",
    "measure_models",
    "measure_slips",
]
