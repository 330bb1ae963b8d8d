"""The ground as records of plain numbers, stepped by compiled functions.

`layout` is the record, `steps` the functions, `grounds` what the rest of the simulation
sees. Begin with `grounds`.
"""
