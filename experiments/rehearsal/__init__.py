"""The whole study rehearsed on simulated devices: does the program find what is true.

`recording` runs the sessions as a person would, `judging` analyses them and holds their
measures against the `bands`; both work on one `plan`. Begin with `plan`.
"""
