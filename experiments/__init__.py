"""The program `traction`: recording, commissioning, calibration, reports, exports.

`commands` has one module per command, `run` the flow of a session, `session` its state
on the disk, `rig` the composition root. Begin with `commands.run`.
"""
