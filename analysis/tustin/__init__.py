"""Tustin's friction model: fit, intervals, identifiability.

Begin with `model`, which is equation (1) of the paper and its fit; `varpro` is the
search over its two nonlinear parameters.
"""
