"""Terrains of a database for other programs: a C99 header, ONNX graphs.

Begin with `exported`: what a target is given. `targets` has a module for every format,
`folder` puts what a target writes together with its README and where it comes from.
"""
