"""A laboratory in a box: the program beside the real kernel's CAN and serial drivers.

`python -m lab` boots Debian's kernel in an emulated machine on guest time, with two CAN
cards on one bus and a serial adapter, and runs scenarios with the unmodified program in
it. Begin in `__main__` for the host's side, in `guest.__main__` for what runs inside;
what is looked at stands in `guest/scenarios/`.
"""
