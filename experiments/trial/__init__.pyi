from .files import (
    TIME_LIMIT,
    EndDetector,
    PaceMonitor,
    SessionMetadata,
    TrialArchive,
    collect_metadata,
    trial_header,
)
from .quality import NextPush, next_push, review_trial

__all__ = [
    "TIME_LIMIT",
    "EndDetector",
    "NextPush",
    "PaceMonitor",
    "SessionMetadata",
    "TrialArchive",
    "collect_metadata",
    "next_push",
    "review_trial",
    "trial_header",
]
