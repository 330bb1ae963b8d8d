from .annotations import (
    LONGEST_TEXT,
    add_note,
    change_verdict,
    clean_text,
    looks_like_trial,
    parse_trial,
    trial_path,
)
from .crash_recovery import recover_session
from .data_files import (
    read_json,
    sha256_of,
    write_json,
    write_new,
    write_new_text,
    write_text,
)
from .journal import Journal, open_journal
from .kept_files import (
    Deviation,
    KeptDataError,
    board_notes,
    check_kept,
    compare_kept,
    compare_trial,
    kept_data_error,
)
from .lock import LOCK_FILE, locked_error, owner_of, session_lock, sign
from .matrix_board import (
    DigestCache,
    MatrixRow,
    compare_board,
    count_board,
    enough_lines,
    next_steps,
    parse_where,
)
from .reducer import KEEP, refusal, replay
from .sidecar import STANCES, TrialOutcome, sidecar_of
from .stance_task import (
    StanceTask,
    adapted_scale,
    read_stance_task,
    stance_outcomes,
    stance_pushes,
)
from .states import Event, SessionPhase, table_lines
from .store import (
    SessionFolder,
    create_session,
    find_session,
    iso_utc,
    list_sessions,
    session_utc_ns,
)
from .trial_files import (
    add_remark,
    kept_pushes,
    kept_sidecars,
    write_next_tare,
)
from .trial_name import TrialName
from .unfinished import UnfinishedSession, find_unfinished

__all__ = [
    "KEEP",
    "LOCK_FILE",
    "LONGEST_TEXT",
    "STANCES",
    "Deviation",
    "DigestCache",
    "Event",
    "Journal",
    "KeptDataError",
    "MatrixRow",
    "SessionFolder",
    "SessionPhase",
    "StanceTask",
    "TrialName",
    "TrialOutcome",
    "UnfinishedSession",
    "adapted_scale",
    "add_note",
    "add_remark",
    "board_notes",
    "change_verdict",
    "check_kept",
    "clean_text",
    "compare_board",
    "compare_kept",
    "compare_trial",
    "count_board",
    "create_session",
    "enough_lines",
    "find_session",
    "find_unfinished",
    "iso_utc",
    "kept_data_error",
    "kept_pushes",
    "kept_sidecars",
    "list_sessions",
    "locked_error",
    "looks_like_trial",
    "next_steps",
    "open_journal",
    "owner_of",
    "parse_trial",
    "parse_where",
    "read_json",
    "read_stance_task",
    "recover_session",
    "refusal",
    "replay",
    "session_lock",
    "session_utc_ns",
    "sha256_of",
    "sidecar_of",
    "sign",
    "stance_outcomes",
    "stance_pushes",
    "table_lines",
    "trial_path",
    "write_json",
    "write_new",
    "write_new_text",
    "write_next_tare",
    "write_text",
]
