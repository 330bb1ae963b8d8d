"""Simulated wrist sensors: firmware, bytes, errors, ports.

`stream` is a sensor seen from its end of the wire, each vendor has a firmware, `errors`
are the measurement errors, `port` and `pty` the line. Begin with `stream`.
"""
