"""Guided calibrations of the rig."""
