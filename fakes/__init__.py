"""Simulated devices at the wire, joined by one plant."""
