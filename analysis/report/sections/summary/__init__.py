"""Summary: what was recorded, how well it is predicted, what to look at first.

Begin with `section`.
"""
