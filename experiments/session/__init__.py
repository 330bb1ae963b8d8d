"""A session on the disk: states, journal, files, recovery; and all of them as a table.

`states` is the table of (phase x event), `reducer` applies the `journal` to it,
`derivation` updates the files, `crash_recovery` rejects the trial of a crash;
`status_table` counts kept against planned trials. Begin with `states`.
"""
