from .chunks import read_file
from .data_files import (
    check_absent,
    check_folders,
    claimed_folder,
    is_claimed,
    is_there,
    list_folder,
    open_data,
    open_folder,
    read_data,
)
from .header import TrialHeader
from .publishing import make_directories, sync_directory
from .reader import TopicRows, TrialReader
from .recover import ROOM, Recovery, recover_file, recovered_path
from .salvage import recorded_seconds
from .verify import VerifiedFile, verify_file
from .views import VIEW_TOPICS, encode_views
from .writer import (
    FLIGHT_TOPICS,
    FORESIGHT_TOPICS,
    TRIAL_TOPICS,
    TRUTH_TOPICS,
    TrialWriter,
    publish,
)

__all__ = [
    "FLIGHT_TOPICS",
    "FORESIGHT_TOPICS",
    "ROOM",
    "TRIAL_TOPICS",
    "TRUTH_TOPICS",
    "VIEW_TOPICS",
    "Recovery",
    "TopicRows",
    "TrialHeader",
    "TrialReader",
    "TrialWriter",
    "VerifiedFile",
    "check_absent",
    "check_folders",
    "claimed_folder",
    "encode_views",
    "is_claimed",
    "is_there",
    "list_folder",
    "make_directories",
    "open_data",
    "open_folder",
    "publish",
    "read_data",
    "read_file",
    "recorded_seconds",
    "recover_file",
    "recovered_path",
    "sync_directory",
    "verify_file",
]
