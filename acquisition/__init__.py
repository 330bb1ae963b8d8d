"""Clock, control loop, samples and recording; independent of robot and sensor make.

`clock` is the only reader of time, `devices` the interfaces of arm and sensor, `sample`
the record of one cycle and `schema` its layout in the file. Begin with `control_loop`;
`ipc`, `recording` and `trial_file` carry its samples to the disk.
"""
