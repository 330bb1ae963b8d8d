"""Slip and terrain while they happen: one sample after the other, nothing ahead.

Begin with `engine`, what runs live and over a record; `training` fits it to trials,
`scores` says what it is worth on trials that it has not seen.
"""
