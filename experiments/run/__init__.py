"""The flow of a session: open, activate, tare, record, review, resume.

`session` opens and closes, `runner` goes from trial to trial on one `context`,
`console_loop` lets time pass; a `trial` is written and its `quality` shown while the
terrain can still be seen. Begin with `runner`.
"""
