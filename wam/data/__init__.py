"""Constants of the arm as TOML.

`wam.model.constants` reads them; sources of every number stand in the file.
"""
