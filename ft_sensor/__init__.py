"""Wrist force/torque sensor: protocols and true force."""
