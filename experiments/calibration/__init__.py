"""Guided calibrations: gravity, friction, sensor and foot, terrain.

Each module is one; `experiments.run.PoseWalk` moves the arm from pose to pose.
"""
