"""What the operator and the scientist do: the program `traction`.

`commands` has one file a command, `run` the flow of a session, `session` its state on
the disk, `rig` the composition root. Begin with `commands.run`.
"""
