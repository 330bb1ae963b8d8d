from .files import (
    TIME_LIMIT,
    EndDetector,
    PaceMonitor,
    SessionMetadata,
    TrialArchive,
    collect_metadata,
    trial_header,
)
from .quality import review_trial

__all__ = [
    "TIME_LIMIT",
    "EndDetector",
    "PaceMonitor",
    "SessionMetadata",
    "TrialArchive",
    "collect_metadata",
    "review_trial",
    "trial_header",
]
