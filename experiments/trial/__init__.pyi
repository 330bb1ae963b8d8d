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
from .running import kept_rows, kept_traces

__all__ = [
    "TIME_LIMIT",
    "EndDetector",
    "NextPush",
    "PaceMonitor",
    "SessionMetadata",
    "TrialArchive",
    "collect_metadata",
    "kept_rows",
    "kept_traces",
    "next_push",
    "review_trial",
    "trial_header",
]
