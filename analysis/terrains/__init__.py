"""Terrain recognition and the terrain database.

Begin with `tabulation`, which makes the terrain database of a study; `database` is what
a locomotion controller queries, `identify` and `verdict` classify terrains, and
`export` writes the database for other programs.
"""
