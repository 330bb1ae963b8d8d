from .board_cache import BoardCache, BoardRow, cache_path, row_of
from .matrix_board import (
    MatrixRow,
    compare_board,
    count_board,
    parse_where,
    see_sessions,
)
from .session_summaries import (
    SeenSession,
    SessionSummary,
    glance,
    glance_sessions,
    summarise,
)
from .upcoming import enough_lines, next_steps

__all__ = [
    "BoardCache",
    "BoardRow",
    "MatrixRow",
    "SeenSession",
    "SessionSummary",
    "cache_path",
    "compare_board",
    "count_board",
    "enough_lines",
    "glance",
    "glance_sessions",
    "next_steps",
    "parse_where",
    "row_of",
    "see_sessions",
    "summarise",
]
