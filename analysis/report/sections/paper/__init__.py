"""The paper's table and figures, and a check of its statements against the study.

Begin with `section`.
"""
