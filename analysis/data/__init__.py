"""Recorded trials as samples ready for a model.

`load` reads a trial file as a `TractionSeries`, `prepare` smooths, thins and windows
it, `events` finds slips, `quality` grades coverage. Begin with `series`.
"""
