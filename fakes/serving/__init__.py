"""The simulated rig as a process, its bus and sensor for other programs.

`rig_process` serves a session, `puck_server` and `sensor_server` any other program.
"""
