"""The first day of an arm, step by step, and the check of every day after it.

A step is a `Step` of its module, C0 to C14 in `procedure`; limits.toml has what each
quantity may be, `evidence` what was measured and whether torque may be sent. Begin
with `procedure`.
"""
