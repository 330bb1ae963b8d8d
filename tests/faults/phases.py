"""When a fault may come: the phases of a session, and what the arm does by itself."""

PHASES = ("preflight", "idle", "tare", "ready", "recording", "review", "end")
MOVING = "moving"  # the arm by itself, between two poses of a calibration
