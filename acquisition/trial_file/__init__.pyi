from .chunks import read_file
from .reader import TrialReader
from .recover import Recovery, recover_file, recovered_path
from .salvage import recorded_seconds
from .verify import VerifiedFile, verify_file
from .writer import (
    FLIGHT_TOPICS,
    TRIAL_TOPICS,
    TRUTH_TOPICS,
    TrialHeader,
    TrialWriter,
    publish,
)

__all__ = [
    "FLIGHT_TOPICS",
    "TRIAL_TOPICS",
    "TRUTH_TOPICS",
    "Recovery",
    "TrialHeader",
    "TrialReader",
    "TrialWriter",
    "VerifiedFile",
    "publish",
    "read_file",
    "recorded_seconds",
    "recover_file",
    "recovered_path",
    "verify_file",
]
