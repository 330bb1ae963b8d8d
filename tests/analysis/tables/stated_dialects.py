"""Options that describe the files of sixteen dialects."""

# Options of files that are not RFC 4180 or not in N, m/s and s.
STATED = {
    "semicolon_comma": {"separator": ";", "decimal": ","},
    "utf16_tab": {"separator": "\t"},
    "sep_line": {"separator": ";", "skipped": frozenset({1})},
    "units_row": {"units": {"v_t": "mm/s"}, "skipped": frozenset({2})},
    "preamble_hash": {"skipped": frozenset({1, 2})},
    "space_columns": {"separator": "blanks"},
    "german_thousands": {"separator": ";", "decimal": ","},
    "negative_load": {"negate": ("F_n",)},
}
