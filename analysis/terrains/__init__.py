"""Which terrain is it, and what traction does it give.

`identify` tells terrains apart by the models of a study, `verdict` says which one a
trial is from, `database` is what a locomotion controller queries, `path_copula` joins
its forces along a path.
"""
