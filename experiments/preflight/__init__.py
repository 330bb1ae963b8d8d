"""Preflight: checks of rig and computer before a session.

`preflight` runs the graded checks, `host_checks` has those of the computer, `page`
collects their lines; `conditions` compares settings with those of an unfinished
session. `host_setup` writes system files, `loop_benchmark` measures the loop. Begin
with `preflight`.
"""
