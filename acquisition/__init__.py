"""Clock, control loop, samples and recording; knows no robot and no sensor brand.

`clock` is the only reader of time, `devices` says what the loop asks of an arm and of a
sensor, `sample` is the record of one cycle and `schema` its layout in the file. Begin
with `control_loop`; `ipc`, `recording` and `trial_file` carry its samples to the disk.
"""
