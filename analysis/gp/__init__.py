"""Exact Gaussian processes: kernels, likelihood with gradient, search, prediction.

Begin with `regression`, which predicts; `kernels` compose with + and *, `likelihood` is
the log marginal likelihood and its gradient, `search` chooses starts and optimises.
"""
