"""Is the rig fit to run, and is it still the rig the session began on.

`preflight` runs the graded checks, `host_checks` those of the computer, `conditions`
compares settings with those of the unfinished session.
"""
