"""The matrix board: what is kept of what is wanted, over all sessions of a data folder.

`session_summaries` reads one session, `board_cache` keeps what was read as long as no
file changes, `matrix_board` counts, `upcoming` says what to record next. Begin with
`matrix_board`.
"""
