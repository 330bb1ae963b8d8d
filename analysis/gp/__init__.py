"""Exact Gaussian processes: kernels, likelihood with gradient, search, prediction.

Begin with `regression`: fit and prediction. `kernels` compose with + and *,
`likelihood` is the log marginal likelihood with its gradient, `search` optimises the
hyperparameters.
"""
