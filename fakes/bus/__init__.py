"""Simulated CAN bus, in this process or on a socket for other programs.

`in_process` is a `can.BusABC` with stepped time, `hub` and `client` are the two ends of
a socket.
"""
