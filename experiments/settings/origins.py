"""Origins of settings: every dotted name with its value and source."""

from collections.abc import Mapping, Sequence
from typing import cast

from acquisition.settings import parse_toml
from analysis.data.recorded_factors import value_text
from experiments.settings.explaining import line_of
from experiments.settings.load import SHIPPED, Settings
from experiments.settings.matrix import TerrainRow


def flatten(value: object, prefix: str = "") -> dict[str, object]:
    """Return the values of nested tables by dotted name, e.g. feet.tread.mass.

    A list of numbers or words is one value; a list of tables is numbered.
    """
    if isinstance(value, Mapping):
        values: dict[str, object] = {}
        for key, inner in cast("Mapping[str, object]", value).items():
            values |= flatten(inner, f"{prefix}.{key}" if prefix else key)
        return values
    if isinstance(value, list | tuple):
        items = cast("Sequence[object]", value)
        if items and all(isinstance(item, Mapping) for item in items):
            values = {}
            for number, item in enumerate(items):
                values |= flatten(item, f"{prefix}[{number}]")
            return values
        return {prefix: list(items)}
    return {prefix: value}


def origin_lines(settings: Settings) -> list[str]:
    """Return one line per setting: name, value, file and line it comes from.

    A cell is one line, since it is made of several tables.
    """
    matrix = settings.matrix
    origin = _origin(settings, "matrix.toml")
    design = matrix.model_dump(exclude={"terrains"})
    rig = settings.rig_text, "rig.toml"
    return [
        *_lines(settings, settings.rig.model_dump(), parse_toml(rig[0]), *rig),
        *(f"{_cell(row)}   ({origin})" for row in matrix.terrains),
        *_lines(settings, design, design, settings.matrix_text, "matrix.toml"),
    ]


def _lines(
    settings: Settings,
    values: Mapping[str, object],
    given: Mapping[str, object],
    text: str,
    file: str,
) -> list[str]:
    """Return one line per value of a file.

    Args:
        settings: all settings.
        values: values in force.
        given: values stated in the file.
        text: text of the file.
        file: name of the file.
    """
    origin, stated = _origin(settings, file), flatten(given)
    lines: list[str] = []
    for name, value in flatten(values).items():
        line = line_of(text, name) if name in stated else None
        location = f"{origin}, line {line}" if line else origin
        source = location if name in stated else f"default, not in {file}"
        lines.append(f"{name} = {_shown(value)}   ({source})")
    return lines


def _origin(settings: Settings, file: str) -> str:
    path = settings.folder / file
    is_shipped = settings.origin == SHIPPED
    if file == "rig.toml" and not is_shipped:
        return settings.origin
    return SHIPPED if is_shipped or not path.is_file() else str(path)


def _cell(row: TerrainRow) -> str:
    """Return a cell of the matrix with all stated and default values."""
    factors = ", ".join(f"{n} {value_text(v)}" for n, v in row.factors.items())
    where = row.place or f"far end {list(row.far_end)}"
    return (
        f"cell {row.name}: foot {row.foot}, {factors or 'no factors'}, {where}, "
        f"{row.incline_deg:+g} degrees, push {row.push_deg}, {row.trials} trials"
    )


def _shown(value: object) -> str:
    if value is None:
        return "none"
    return f'"{value}"' if isinstance(value, str) else str(value)
