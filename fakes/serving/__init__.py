"""Servers of the simulated rig, its bus and its sensor for other processes.

`rig_process` serves a session, `puck_server` and `sensor_server` any other program.
"""
