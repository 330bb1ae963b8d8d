"""What leaves the program: tables, packages, publications, terrains, bundles.

`trial_tables` writes the kept trials as tables, `publication` a whole study as an
RO-Crate. Begin with `trial_tables`.
"""
