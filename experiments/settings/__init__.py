"""rig.toml, matrix.toml and calibration files: read, checked, explained.

`load` returns `Settings` or reports every error, `rig` and `matrix` define the files,
`origins` finds the source of a value. Begin with `load`.
"""
