"""When a fault may come: the phases of a session, and a move of the arm by itself."""

PHASES = ("preflight", "idle", "tare", "ready", "recording", "review", "end")
MOVING = "moving"  # the arm by itself, between two poses of a calibration
