"""Summary: samples, prediction errors and outlier trials.

Begin with `section`.
"""
