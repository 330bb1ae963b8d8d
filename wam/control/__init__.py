"""Control law: joint torques from joint positions.

`controller` sums gravity, the virtual mass at the foot, the lock of joint 7
(`joint_lock`), soft walls before the stops (`soft_walls`), and position hold or moves
in joint space (`position_control`). Begin with `controller`.
"""
