"""The simulated bus: in this process, or on a socket for other programs.

`in_process` is a `can.BusABC` on stepped time, `hub` and `client` the two ends of a
socket.
"""
