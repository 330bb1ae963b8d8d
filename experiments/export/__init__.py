"""Exports: tables, data packages, publications, terrain databases, bundles.

`trial_tables` writes the kept trials as tables, `publication` a whole study as an
RO-Crate. Begin with `trial_tables`.
"""
