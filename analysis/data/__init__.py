"""Preparation of recorded trials: smoothing, thinning, windowing, quality.

Begin with `series`, then `load`, which reads a trial file, and `prepare`; `events`
finds slips, `quality` grades coverage.
"""
