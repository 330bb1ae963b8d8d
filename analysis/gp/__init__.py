"""Exact Gaussian processes: kernels, likelihood with gradient, search, prediction.

`kernels` compose with + and *, `likelihood` is the log marginal likelihood and its
gradient, `search` chooses starts and optimises, `regression` predicts. Begin with
`regression`.
"""
