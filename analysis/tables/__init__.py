"""Tables of other programs as trials: text, Parquet, npz and data packages.

Begin with `loading`; `reading` finds encoding, delimiter, header, units and decimal
mark of a text. What does not fit is refused with file, line, column, what stands there
and what was expected.
"""
