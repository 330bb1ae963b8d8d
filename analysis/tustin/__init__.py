"""Tustin's friction model: fit, intervals, identifiability.

Begin with `model`: equation (1) of the paper and its fit; `varpro` searches over the
two nonlinear parameters.
"""
