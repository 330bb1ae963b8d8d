"""A virtual laboratory: the program with the real kernel's CAN and serial drivers.

`python -m lab` boots Debian's kernel in an emulated machine with its own time (guest
time), two CAN cards on one bus and a serial adapter, and runs scenarios with the
unmodified program in it. Begin in `__main__` for the host side and in `guest.__main__`
for the guest side; the scenarios are in `guest/scenarios/`.
"""
