"""The far ends of bus and serial line, in a process of the host.

The simulated arm and sensor run here at the host's speed, called by the guest's relay.
Begin in `__main__`; `proxy_device` receives the calls from the emulator.
"""
