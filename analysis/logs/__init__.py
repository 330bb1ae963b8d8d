"""Logs of other robots: MCAP, rosbag2 (SQLite, MCAP) and ROS 1 bags, read with bounds.

`opening.open_log` gives a `LogFile` of any format, `definitions` takes the definition
of a message apart, `decoding` reads messages by it. Definitions are interpreted, never
executed; every size and count is checked before anything is allocated for it.
"""
