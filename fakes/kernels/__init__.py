"""Functions of the simulation that are compiled to machine code when numba is there.

`compiler` is the one door to numba, `choice` says whether the compiled simulation runs.
Without numba, or without a folder to keep the machine code in, the simulation runs in
Python and Pinocchio. Begin with `choice`.
"""
