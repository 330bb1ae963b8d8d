"""The flow of a session: open, activate, tare, record, review, resume.

`session` opens and closes, `runner` goes from trial to trial on one `context`,
`console_loop` lets time pass, `resume` continues, `pose_walk` moves the arm by itself.
Begin with `runner`.
"""
