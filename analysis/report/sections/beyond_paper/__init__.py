"""Beyond the paper: uncertainty, new trials, forces from rest, recognition, trends.

A module a subject, with its numbers, table and figures. Begin with `section`.
"""
