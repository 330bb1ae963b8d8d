"""Import of logs from other robots: file formats, and conversion to trials.

Begin with `request`, the user's input, then `importing`, which computes v_t, F_n and
F_t; `opening` reads MCAP, rosbag2 and ROS 1 bags, `checks` compares the input with the
log, `suggestions` writes a command line to edit.
"""
