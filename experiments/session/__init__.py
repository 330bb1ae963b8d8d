"""A session on the disk: states, journal, files, recovery; and all of them as a table.

`states` is the table of (phase x event), `reducer` applies the `journal` to it,
`derivation` lets the files follow, `crash_recovery` puts the trial of a crash away;
`status_table` counts what is kept of what is wanted. Begin with `states`.
"""
