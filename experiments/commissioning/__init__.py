"""The first day of an arm, step by step: what is kept of it, and what that is worth.

`steps` has the steps and what makes them stale, `record` the file, `gate` what is
missing. How the steps are done stands in `experiments.proving`.
"""
