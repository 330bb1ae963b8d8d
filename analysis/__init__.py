"""From trial files to models, terrains and the report; touches no device.

Begin with `data`, which loads and prepares samples, then `study`, which fits and
cross-validates the models of `tustin` and `gp`; `tables` and `logs` read what other
programs recorded, `terrains` and `report` are what comes out.
"""
