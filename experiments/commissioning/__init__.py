"""Commissioning of an arm in steps C0 to C14, and the daily check.

Each step is a `Step` in its module; `procedure` lists them, limits.toml has the
limits, `evidence` the records and the decision whether torque may be sent. Begin
with `procedure`.
"""
