"""Logs of other robots: the containers that hold them, and trials made from them.

Begin with `request`, which is what a person states, then `importing`, which makes v_t,
F_n and F_t of it; `opening` reads MCAP, rosbag2 and ROS 1 bags alike, `checks` holds
what was stated against the log, `suggestions` writes the command line to be edited.
"""
