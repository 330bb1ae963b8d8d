"""The 500 Hz control loop: read, check, command, record.

`loop` keeps the grid of deadlines, `cycle` is the work of one period, `guard` derives
verdicts from limits and observations, `states` is the state machine of the arm. Begin
with `cycle`; nothing here waits, logs or opens a file.
"""
