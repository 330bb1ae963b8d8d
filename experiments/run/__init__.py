"""The flow of a session: open, activate, tare, record, review, resume.

`session` opens and closes, `runner` goes from trial to trial on one `context`,
`console_loop` runs the console's cycle; a `trial` is written and its `quality` shown
before the terrain is reset. Begin with `runner`.
"""
