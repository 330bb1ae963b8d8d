"""What is at the far ends of bus and serial line, in a process of the host.

The simulated arm and sensor run here at the host's own speed; the guest's relay calls
them. Begin in `__main__`; `proxy_device` is how a call comes out of the emulator.
"""
