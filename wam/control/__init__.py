"""Joint torques from joint positions: the control law and its parts.

`controller` adds gravity, the virtual mass at the foot, the lock of joint 7
(`joint_lock`), soft walls before the stops (`soft_walls`), and what holds the arm or
moves it in joint space (`position_control`). Begin with `controller`.
"""
