from .advice import Advice, advise
from .knowledge import MOST_TRIALS, Knowledge
from .records import Aim, PushRecord, push_record
from .stopping import TARGETS, Stopping, stopping_of

__all__ = [
    "MOST_TRIALS",
    "TARGETS",
    "Advice",
    "Aim",
    "Knowledge",
    "PushRecord",
    "Stopping",
    "advise",
    "push_record",
    "stopping_of",
]
