"""The arm as a model: constants, kinematics, gravity, the tool on its wrist.

`arm_model` and `clearance` import Pinocchio, `constants` reads the table of the arm,
`tool` the sensor and foot, `gravity` and `moments` what the arm weighs. Begin with
`arm_model`.
"""
