"""Recorded sessions, or tables from elsewhere, to the studies and pages of `report`.

What a person chooses, the trials that are loaded, and what only sessions can tell of
them: cells, checks, provenance, simulated truth. Begin with `sessions`.
"""
