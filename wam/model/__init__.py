"""Arm model: constants, kinematics, dynamics, gravity, tool, collision distances.

`arm_model` and `clearance` use Pinocchio, `constants` reads the arm's TOML file, `tool`
describes sensor and foot, `gravity` and `moments` the gravity torques. Begin with
`arm_model`.
"""
