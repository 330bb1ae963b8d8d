"""Phases in which a fault may occur: those of a session and a move by the arm."""

PHASES = ("preflight", "idle", "tare", "ready", "recording", "review", "end")
MOVING = "moving"  # a move by the arm between two poses of a calibration
