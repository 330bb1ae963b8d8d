"""What is kept of a commissioning, and what it is worth today.

`order` names the steps and what each stands on, `record` and `daily_record` are the
files, `gate` says whether torque may be sent; it is all that the preflight reads. Begin
with `gate`.
"""
