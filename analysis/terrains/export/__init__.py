"""Export of a terrain database for other programs: a C99 header, ONNX graphs.

Begin with `exported`, the input of a target. `targets` has a module for every format;
`folder` adds a README and the origin to the files of a target.
"""
