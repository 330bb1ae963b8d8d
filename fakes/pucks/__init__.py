"""Simulated motor controllers and safety module, frame by frame.

`network` is what a host sees, `bank` the seven motor pucks, `safety_module` the eighth
device, `wire` the time that frames take. Begin with `network`.
"""
