"""rig.toml, matrix.toml and calibration files: read, checked, explained.

`load` returns `Settings` or names every error, `rig` and `matrix` say what may stand in
the files, `origins` where a value came from. Begin with `load`.
"""
