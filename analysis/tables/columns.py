"""Names and units of table columns, from the header or the command line."""

import csv
import re
from collections.abc import Mapping, Sequence

from acquisition.errors import SettingsError

COLUMNS = ("t", "v_t", "F_n", "F_t")
PREPARED = "kept_row"  # column that marks tables prepared before
TRIAL, TERRAIN = "trial", "terrain"  # text columns that divide a table
GROUPS = (TRIAL, TERRAIN)
_MOST_SKIPPED = 10_000  # last line that --skip accepts
MOST_INPUTS = 6  # in addition to F_n and v_t
SIMULATED = "simulated"  # column that is 1 in every row if the devices were simulated
_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "d": 86_400.0}
_SPEEDS = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6}
_GRAM_FORCE = 9.80665e-3  # N
_FORCES = {
    "N": 1.0,
    "mN": 1e-3,
    "kN": 1e3,
    "gf": _GRAM_FORCE,
    "kgf": 1e3 * _GRAM_FORCE,
    "lbf": 4.4482216152605,
}
_MASSES = {"g": "gf", "kg": "kgf", "lb": "lbf", "lbs": "lbf"}
# Factor from each accepted unit of a column to its SI unit.
UNITS: Mapping[str, Mapping[str, float]] = {
    "t": _TIMES,
    "v_t": _SPEEDS,
    "F_n": _FORCES,
    "F_t": _FORCES,
}
_EVERY_UNIT = {unit for units in UNITS.values() for unit in units} | {*_MASSES}
# Characters that other programs write for minus, micro and blank.
_SIGNS = str.maketrans(
    {"\u2212": "-", "\u00b5": "u", "\u03bc": "u", "\u00a0": " ", "\u2007": " "}
)
_HEADER = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]")
# Common names of the columns in other programs: lower-case letters only.
_KNOWN_AS = {
    "t": {"t", "time", "times", "timestamp", "ts", "seconds", "sec", "zeit", "temps"},
    "v_t": {"vt", "v", "vel", "velocity", "speed", "vx", "vslip", "slipvelocity"},
    "F_n": {"fn", "fz", "normal", "normalforce", "load", "normalload"},
    "F_t": {"ft", "fx", "tangential", "traction", "friction", "tangentialforce"},
}


def plain(text: str) -> str:
    """Replace Unicode minus, micro and fixed-width blanks by ASCII.

    U+2212 becomes a minus, U+00B5 and U+03BC a u, U+00A0 and U+2007 a blank.
    """
    return text if text.isascii() else text.translate(_SIGNS)


def parse_columns(text: str) -> dict[str, str]:
    """Parse column names such as `t=t_s,"v_t=Speed, foot",F_n=3,...`.

    Items with commas are quoted; a number that is not a name is a position, from 1.
    Columns that are not mentioned keep their own name. `trial=` and `terrain=` name
    text columns that group the rows.

    Raises:
        SettingsError: a part is not NAME=COLUMN, or NAME is not a column of the
            analysis or was named before.
    """
    columns: dict[str, str] = {}
    for part in _items("--columns", text):
        name, _, column = (piece.strip() for piece in part.partition("="))
        if not column or name not in {*COLUMNS, *GROUPS}:
            raise _not_named(text, part)
        if name in columns:
            raise SettingsError(
                f"--columns {text}: {name} is named twice.", hint="Leave one."
            )
        columns[name] = column
    return {name: name for name in COLUMNS} | columns


def _items(option: str, text: str) -> list[str]:
    """Split an option like a row of CSV: items with commas are quoted.

    Raises:
        SettingsError: quotes are not closed.
    """
    try:
        rows = list(csv.reader([text], skipinitialspace=True, strict=True))
    except csv.Error as error:
        raise SettingsError(
            f"{option} {text[:60]}: its quotes do not fit ({error}).",
            hint='Put an item with a comma into quotes: "Speed, foot".',
        ) from error
    return [item for part in rows[0] if (item := plain(part).strip())] if rows else []


def _not_named(text: str, part: str) -> SettingsError:
    return SettingsError(
        f"--columns {text}: {part!r} does not name a column.",
        hint="Write e.g. --columns t=t_s,v_t=vt_mps,F_n=Fn_N,F_t=Ft_N",
    )


def parse_inputs(text: str) -> tuple[str, ...]:
    """Parse inputs such as `v_t,F_n,skid_deg`; returns those other than v_t and F_n.

    Raises:
        SettingsError: v_t or F_n is missing, a name occurs twice or is not an input, or
            there are too many.
    """
    names = _items("--inputs", text)
    own = [name for name in names if name in {"v_t", "F_n"}]
    further = tuple(name for name in names if name not in own)
    taken = {*COLUMNS, *GROUPS, PREPARED, SIMULATED}
    reason = ""
    if sorted(own) != ["F_n", "v_t"]:
        reason = "v_t and F_n are always inputs; name each once"
    elif len(set(further)) < len(further) or taken & set(further):
        reason = "a name occurs twice, or is not an input"
    elif not 1 <= len(further) <= MOST_INPUTS:
        reason = f"{len(further)} further inputs, 1 to {MOST_INPUTS} are allowed"
    if reason:
        raise SettingsError(
            f"--inputs {text}: {reason}.",
            hint="Write e.g. --inputs v_t,F_n,skid_deg, with columns of the table.",
        )
    return further


def parse_covariates(text: str, known: Sequence[str] | None = None) -> tuple[str, ...]:
    """Parse the columns to test, such as `height,tilt`.

    Args:
        text: from the command line.
        known: available names; None = those of any table.

    Raises:
        SettingsError: there is no such column, a name occurs twice or is that of an
            input, or there are too many.
    """
    names = tuple(_items("--covariate", text))
    taken = {*COLUMNS, *GROUPS, PREPARED, SIMULATED} & set(names)
    strangers = [] if known is None else [n for n in names if n not in known]
    reason = ""
    if strangers:
        reason = f"there is no {', '.join(strangers)}"
    elif len(set(names)) < len(names) or taken:
        reason = "a name occurs twice, or is not a further column"
    elif not 1 <= len(names) <= MOST_INPUTS:
        reason = f"{len(names)} columns, 1 to {MOST_INPUTS} are allowed"
    if reason:
        what = "a column of every table" if known is None else ", ".join(known)
        raise SettingsError(
            f"--covariate {text[:60]}: {reason}.",
            hint=f"Name {what}, with commas between.",
        )
    return names


def parse_units(text: str) -> dict[str, str]:
    """Parse units of columns such as `v_t=mm/s,F_t=mN`.

    Raises:
        SettingsError: a part is not NAME=UNIT, or the unit does not suit the column.
    """
    units: dict[str, str] = {}
    for part in _items("--unit", text):
        name, equals, unit = (piece.strip() for piece in part.partition("="))
        if not equals or unit not in UNITS.get(name, {}):
            raise SettingsError(
                f"--unit {text}: {part!r} does not give the unit of a column.",
                hint="; ".join(f"{n}: {', '.join(UNITS[n])}" for n in COLUMNS),
            )
        units[name] = unit
    return units


def parse_names(text: str) -> tuple[str, ...]:
    """Parse columns of the analysis such as `F_n,F_t`.

    Raises:
        SettingsError: a name is not a column of the analysis.
    """
    names = tuple(_items("--negate", text))
    strangers = [name for name in names if name not in COLUMNS]
    if strangers or not names:
        raise SettingsError(
            f"--negate {text}: {', '.join(strangers) or 'nothing'} is not a column of "
            "the analysis.",
            hint="Write e.g. --negate F_n,F_t",
        )
    return names


def parse_separator(text: str) -> str:
    """Parse the separator between columns: a character, `tab` or `blanks`."""
    return {"tab": "\t", "\\t": "\t"}.get(text, text)


def parse_lines(text: str) -> frozenset[int]:
    """Parse line numbers such as `1-3,5`.

    Raises:
        SettingsError: a part is not a line, or a number is too large.
    """
    lines: set[int] = set()
    for part in _items("--skip", text):
        first, dash, last = part.partition("-")
        last = last if dash else first
        is_span = all(n.isascii() and n.isdecimal() for n in (first, last))
        if not is_span or not 1 <= int(first) <= int(last) <= _MOST_SKIPPED:
            raise SettingsError(
                f"--skip {text[:60]}: {part!r} is no line.",
                hint=f"Write e.g. --skip 1-3,5, up to {_MOST_SKIPPED}.",
            )
        lines |= set(range(int(first), int(last) + 1))
    return frozenset(lines)


def split_header(header: str) -> tuple[str, str]:
    """Split `v_t [mm/s]`, `v_t (mm/s)` or `v_t/mm/s` into name and unit.

    Without a unit, the second part is empty. A slash separates them only if a unit
    follows and the slash is not part of the unit, as in `speed m/s`.
    """
    if match := _HEADER.fullmatch(header):
        return match["name"], match["unit"].strip()
    name, _, unit = header.partition("/")
    name, unit = name.strip(), unit.strip()
    within = f"{re.split(r'[ _]', name)[-1]}/{unit}"
    is_stated = unit in _EVERY_UNIT and within not in _EVERY_UNIT
    return (name, unit) if is_stated else (header, "")


def factor(name: str, stated: str, asked: str) -> float:
    """Return the factor that converts a column to its SI unit.

    Args:
        name: name of the column.
        stated: unit in the table; empty = none.
        asked: unit on the command line; empty = none.

    Raises:
        SettingsError: the two differ, or the unit is not known.
    """
    stated = plain(stated)
    if stated and asked and asked not in {stated, _MASSES.get(stated)}:
        raise SettingsError(
            f"{name} is in {stated} by the table's header and in {asked} by --unit.",
            hint="Leave --unit out, or correct the header; a package is exported or "
            "imported again.",
        )
    unit = stated or asked
    if asked and asked == _MASSES.get(stated):
        return UNITS[name][asked]
    if unit in _MASSES and name.startswith("F"):
        raise SettingsError(
            f"{name} is in {unit!r}, which is a mass, not a force.",
            hint=f"If a scale shows the force so: --unit {name}={_MASSES[unit]}; 1 "
            f"{_MASSES[unit]} is {_FORCES[_MASSES[unit]]:.9g} N.",
        )
    if unit and unit not in UNITS[name]:
        raise SettingsError(
            f"{name} is in {unit!r}, which is not a unit of {name}.",
            hint=f"It may be in {', '.join(UNITS[name])}.",
        )
    return UNITS[name][unit] if unit else 1.0


def find_column(header: Sequence[str], column: str) -> list[int]:
    """Return the positions of a column in a header, from 0: none, one or several.

    A header `v_t [mm/s]` matches the column v_t or that whole name. A number that is
    not a name is a position, from 1.
    """
    bare = [split_header(name)[0] for name in header]
    for among in (header, bare):
        if positions := [k for k, name in enumerate(among) if name == column]:
            return positions
    if column.isdecimal() and 1 <= int(column) <= len(header):
        return [int(column) - 1]
    return []


def columns_hint(header: Sequence[str], wanted: Mapping[str, str]) -> str:
    """Suggest `--columns ...` for a header that lacks some of the wanted columns.

    Columns with a common name are filled in; the others are left open. If only inputs
    or covariates are missing, their options are suggested.

    Args:
        header: names in the table.
        wanted: names searched for, by column of the analysis or by input.
    """
    items: list[str] = []
    missing: set[str] = set()
    for name, column in wanted.items():
        is_present = bool(find_column(header, column))
        if not is_present:
            missing.add(name)
        if name in {*COLUMNS, *GROUPS}:
            candidates = [column] if is_present else _columns_like(header, name)
            items.append(f"{name}={candidates[0] if len(candidates) == 1 else '...'}")
    if missing and not missing & {*COLUMNS, *GROUPS}:
        return "Name columns that it has: --inputs v_t,F_n,... or --covariate NAME"
    row = ",".join(f'"{item}"' if "," in item else item for item in items)
    is_plain = re.fullmatch(r"[\w.=,/]*", row, re.ASCII) is not None
    return "Name them: --columns " + (row if is_plain else f"'{row}'")


def place_hint(name: str, places: Sequence[int]) -> str:
    """Suggest how to select one of several columns of the same name.

    Args:
        name: column of the analysis, or an input.
        places: its positions in the header, from 0.
    """
    numbers = [str(place + 1) for place in places[:4]]
    if name in {*COLUMNS, *GROUPS}:
        return "Take one by its position: --columns " + " or ".join(
            f"{name}={number}" for number in numbers
        )
    return f"Take one by its position: {' or '.join(numbers)} for {name} in --inputs"


def _columns_like(header: Sequence[str], name: str) -> list[str]:
    """Return the columns whose name is a common one for a column of the analysis."""
    bare = [split_header(column)[0] for column in header]
    return [
        column
        for column in bare
        if re.sub(r"[^a-z]", "", column.lower()) in _KNOWN_AS.get(name, ())
    ]
