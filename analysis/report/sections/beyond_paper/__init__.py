"""Beyond the paper: uncertainty, new trials, forces from rest, recognition, trends.

One module per subject, with its numbers, table and figures. Begin with `section`.
"""
