"""Rehearsal of the whole study on simulated devices, checked against bands.

`recording` runs the sessions as a person would, `judging` analyses them and compares
their measures with the `bands`; both use one `plan`. Begin with `plan`.
"""
