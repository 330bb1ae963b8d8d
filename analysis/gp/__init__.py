"""Exact Gaussian processes: kernels, likelihood with gradient, search, prediction.

Begin with `regression`: fit and prediction. `kernels` compose with + and *; the neural
network kernel is in `arcsine`. `likelihood` is the log marginal likelihood with its
gradient, `search` optimises the hyperparameters.
"""
