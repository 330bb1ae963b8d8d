"""The 500 Hz loop: read, judge, command, sample.

`loop` keeps the grid of deadlines, `cycle` is the work of one period, `guard` turns
limits and observations into verdicts, `states` says what the arm may be doing and what
each event does to it. Begin with `cycle`; nothing here waits, logs or opens a file.
"""
