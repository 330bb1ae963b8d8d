"""Constants of the arm as TOML.

`wam.model.constants` reads them; the file names the source of every number.
"""
