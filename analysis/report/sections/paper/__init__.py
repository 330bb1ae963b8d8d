"""The paper's table and figures, and its statements held against the study.

Begin with `section`.
"""
