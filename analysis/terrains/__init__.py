"""Which terrain is it, and what traction does it give.

`identify` tells terrains apart by the models of a study, `database` is the table that a
locomotion controller queries.
"""
