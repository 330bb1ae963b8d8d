"""Calibration of sensor, foot and container: least-squares fits and their files.

`fit` identifies mass, centre of mass, bias and mounting from wrenches in known poses,
`files` and `sensor_file` read and write the results.
"""
