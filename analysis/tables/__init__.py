"""Import of tables from other programs: text, Parquet, npz and data packages.

Begin with `loading`; `text` reads text tables and refuses what does not fit with file,
line and column.
"""
