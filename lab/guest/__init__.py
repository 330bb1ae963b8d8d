"""The guest side, inside the emulated machine: the scenarios and their tools.

`__main__` runs them one after the other; each gets a `MachineRoom`.
"""
