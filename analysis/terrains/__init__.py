"""Which terrain is it, and what traction does it give.

Begin with `tabulation`, which makes the terrain database of a study; `database` is what
a locomotion controller queries, `identify` and `verdict` tell terrains apart, and
`export` writes the database for other programs.
"""
