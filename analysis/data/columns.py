"""Columns of a table: their names and units, of its header or of the command line."""

import re
from collections.abc import Mapping

from acquisition import SettingsError

COLUMNS = ("t", "v_t", "F_n", "F_t")
_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
_SPEEDS = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6}
_FORCES = {"N": 1.0, "mN": 1e-3, "kN": 1e3}
# Factor from each unit that a column may have to its own.
UNITS: Mapping[str, Mapping[str, float]] = {
    "t": _TIMES,
    "v_t": _SPEEDS,
    "F_n": _FORCES,
    "F_t": _FORCES,
}
_HEADER = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]")


def parse_columns(text: str) -> dict[str, str]:
    """Return the names of the columns from `t=t_s,v_t=vt_mps,...`.

    Columns that are not mentioned keep their own name.

    Raises:
        SettingsError: a part is not NAME=COLUMN, or names no column of the analysis.
    """
    columns = {name: name for name in COLUMNS}
    for part in filter(None, text.split(",")):
        name, equals, column = (piece.strip() for piece in part.partition("="))
        if not (equals and column) or name not in columns:
            raise SettingsError(
                f"--columns {text}: {part!r} does not name a column.",
                hint="Write e.g. --columns t=t_s,v_t=vt_mps,F_n=Fn_N,F_t=Ft_N",
            )
        columns[name] = column
    return columns


def parse_units(text: str) -> dict[str, str]:
    """Return the units of columns from `v_t=mm/s,F_t=mN`.

    Raises:
        SettingsError: a part is not NAME=UNIT, or the column has no such unit.
    """
    units: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        name, equals, unit = (piece.strip() for piece in part.partition("="))
        if not equals or unit not in UNITS.get(name, {}):
            raise SettingsError(
                f"--unit {text}: {part!r} does not give the unit of a column.",
                hint="; ".join(f"{n}: {', '.join(UNITS[n])}" for n in COLUMNS),
            )
        units[name] = unit
    return units


def split_header(header: str) -> tuple[str, str]:
    """Return name and unit of `v_t [mm/s]` or `v_t (mm/s)`; no unit is empty."""
    match = _HEADER.fullmatch(header)
    return (match["name"], match["unit"].strip()) if match else (header, "")


def factor(name: str, stated: str, asked: str) -> float:
    """Return what turns a column into its own unit.

    Args:
        name: of the column.
        stated: its unit as the table says; empty where it says none.
        asked: its unit as the command line says; empty where it says none.

    Raises:
        SettingsError: the two differ, or the table's unit is not known.
    """
    if stated and asked and stated != asked:
        raise SettingsError(
            f"{name} is in {stated} by the table's header and in {asked} by --unit.",
            hint="Leave --unit out, or mend the header.",
        )
    unit = stated or asked
    if unit and unit not in UNITS[name]:
        raise SettingsError(
            f"{name} is in {unit!r}, which is no unit of it.",
            hint=f"It may be in {', '.join(UNITS[name])}.",
        )
    return UNITS[name][unit] if unit else 1.0
