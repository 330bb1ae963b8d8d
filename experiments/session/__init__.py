"""A session on the disk: states, journal, files, recovery; and all of them as a table.

`states` is the table of (phase x event), `reducer` applies the `journal` to it,
`trial_files` follow the journal, `crash_recovery` finishes what a kill cut short;
`status_table` counts what is kept of what is wanted. Begin with `states`.
"""
