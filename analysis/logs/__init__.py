"""Logs of other robots: the containers that hold them, and trials made from them.

Begin with `opening`, which reads MCAP, rosbag2 and ROS 1 bags alike, and `importing`,
which makes v_t, F_n and F_t of joint states, wrenches and a URDF.
"""
