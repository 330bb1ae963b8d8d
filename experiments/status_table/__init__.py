"""The table of `traction status`: what is kept of what is wanted, over all sessions.

`session_summaries` reads one session, `table` counts, `upcoming` says what to record
next. Begin with `table`.
"""
