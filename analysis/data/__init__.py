"""Recorded trials and foreign tables as samples ready for a model.

`load` reads a trial file, `tables` a foreign table; both give a `TractionSeries`.
`prepare` smooths, thins and windows it, `events` finds slips, `quality` grades
coverage.
"""
