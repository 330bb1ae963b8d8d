"""Faults on demand: when they come and what they do to the computer.

`plan` reads `--fault NAME@Tn+SECONDSs`, `host_faults` spoils disk, lock and program;
faults of the devices are injected by the simulated rig.
"""
