"""Records of a commissioning, and their validity today.

`order` lists the steps and their inputs, `record` and `daily_record` are the files,
`gate` decides whether torque may be sent; the preflight uses nothing else. Begin with
`gate`.
"""
