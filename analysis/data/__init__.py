"""Recorded trials as samples ready for a model: smoothed, thinned, windowed, graded.

Begin with `series`, then `load`, which reads a trial file, and `prepare`; `events`
finds slips, `quality` grades coverage.
"""
