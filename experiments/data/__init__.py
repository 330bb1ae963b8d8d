"""Shipped defaults: rig.toml and matrix.toml."""
