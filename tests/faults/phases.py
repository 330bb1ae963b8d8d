"""Phases in which a fault may occur: those of a session and an autonomous move."""

PHASES = ("preflight", "idle", "tare", "ready", "recording", "review", "end")
MOVING = "moving"  # an autonomous move between two poses of a calibration
