"""Logs of other robots as trials: joints and wrench become v_t, F_t and F_n.

`robot` is the kinematics of a URDF, `channels` joints and wrench over time,
`estimates` tare, weight, lag, ground and direction with their spreads, `importing`
puts them together, `record` is what `import.json` says of it. Begin with `importing`.
"""
