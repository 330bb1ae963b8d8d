"""Sensor, foot and container measured: least-squares fits and their files.

`fit` finds mass, centre, bias and mounting from wrenches in known poses, `files` and
`sensor_file` read and write what was found.
"""
