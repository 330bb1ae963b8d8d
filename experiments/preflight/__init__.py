"""Is the rig fit to run, and is it still the rig the session began on.

`preflight` runs the graded checks, `host_checks` has those of the computer, `page`
takes their lines; `conditions` compares settings with those of the unfinished session.
"""
