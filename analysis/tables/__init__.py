"""Tables of other programs as trials: text, Parquet, npz and data packages.

Begin with `loading`; `reading` finds encoding, delimiter, header, units and decimal
mark of a text, and refuses what does not fit with file, line and column.
"""
