"""Shipped defaults and texts: rig.toml, matrix.toml, messages.toml.

`experiments.settings` and `experiments.messages` read them.
"""
