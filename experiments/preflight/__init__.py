"""Are rig and computer fit to run, and is it still the rig the session began on.

`preflight` runs the graded checks, `host_checks` has those of the computer, `page`
takes their lines; `conditions` compares settings with those of the unfinished session.
`host_setup` is what the computer needs, `loop_benchmark` what its loop achieves. Begin
with `preflight`.
"""
