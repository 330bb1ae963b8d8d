"""A session on the disk: states, journal, files, recovery.

`states` is the table of (phase x event), `reducer` applies the `journal` to it,
`trial_files` follow the journal, `crash_recovery` finishes what a kill cut short. Begin
with `states`.
"""
