"""Simulated wrist sensors: firmware, bytes, errors, ports.

`stream` is a sensor seen from its end of the wire, each make a firmware, `errors` what
it adds to the truth, `port` and `pty` the line. Begin with `stream`.
"""
