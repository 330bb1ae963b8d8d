"""The simulated bus: in this process, on a socket, on any python-can adapter.

`in_process` is a `can.BusABC` on stepped time and a door to it, `hub` and `client` the
two ends of a socket, `adapter` any other bus.
"""
