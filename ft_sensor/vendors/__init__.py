"""Makes of sensors, one module each: protocol, start-up, settings.

Bota, Robotous and OptoForce on a serial line, ATI on the network, Barrett on the arm's
bus. A new make is a new module here and an entry in the registry.
"""
