"""matrix.toml of version 2 as text: from one of version 1, or from a few answers."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from acquisition.errors import SettingsError
from experiments.settings.design import ABSENT, MOST_CELLS
from experiments.settings.matrix import RESET, MatrixSettings, TerrainRow

_HEAD = """\
# The matrix: what is to be found out. SI units unless a key says so.
# factors: what varies between the cells. A cell states every one of them, or "-" where
# it does not apply. crosses: every combination of the lists becomes a cell.
version = 2
"""
_D50 = """
[[factors]]
name = "d50"  # grain size, of which half is finer
unit = "mm"
kind = "number"
scale = "log"
"""
FAR_END, RISE = (0.70, 0.0, 0.12), 0.0068  # m; m higher per degree of incline
TRAVEL = 0.45  # m
_LONGEST = 24  # characters of a name


@dataclass(frozen=True, slots=True)
class AskedFactor:
    """A factor as a person names it.

    Attributes:
        name: of the factor.
        unit: of numbers; "" = none.
        levels: numbers, or words.
    """

    name: str
    unit: str
    levels: tuple[float, ...] | tuple[str, ...]

    @property
    def is_number(self) -> bool:
        """Whether its levels are numbers."""
        return isinstance(self.levels[0], float)


@dataclass(frozen=True, slots=True)
class AskedDesign:
    """What a person wants to find out.

    Attributes:
        sizes: grain sizes [mm]; () = no stones, a plate.
        factors: what else varies.
        inclines: of the containers [degrees].
        feet: names of the feet.
        trials: of every cell.
    """

    sizes: tuple[float, ...]
    factors: tuple[AskedFactor, ...]
    inclines: tuple[float, ...]
    feet: tuple[str, ...]
    trials: int


def version_2_of(matrix: MatrixSettings) -> str:
    """Return a matrix of version 1 as one of version 2: the same cells, same names."""
    cells = "".join(_cell(row) for row in matrix.terrains)
    return f"{_HEAD}{_D50}{cells}"


def _cell(row: TerrainRow) -> str:
    values: dict[str, object] = {
        "name": row.name,
        "foot": row.foot,
        "d50": ABSENT if row.d50 is None else row.d50,
        "incline_deg": row.incline_deg,
        "heading_deg": row.heading_deg,
        "far_end": list(row.far_end),
        "travel": row.travel,
        "trials": row.trials,
        "start_q": None if row.start_q is None else list(row.start_q),
        "reset": list(row.reset) if row.reset != RESET else None,
        "calibration": row.calibration,
    }
    return "\n[[cells]]\n" + _lines(values)


def _lines(values: Mapping[str, object]) -> str:
    """Return keys and values of a table; what is None is left out."""
    return "".join(
        f"{key} = {json.dumps(value, ensure_ascii=False)}\n"
        for key, value in values.items()
        if value is not None
    )


def place_of(incline: float) -> str:
    """Return the name of the place of a container with an incline [degrees]."""
    if incline == 0.0:
        return "level"
    return f"{'down' if incline > 0.0 else 'up'}{abs(incline):g}".replace(".", "_")


def matrix_text(asked: AskedDesign) -> str:
    """Return the matrix that a person asked for: one cross for each incline.

    Raises:
        SettingsError: it would have too many cells, or names that are too long.
    """
    text = _HEAD + (_D50 if asked.sizes else "")
    for factor in asked.factors:
        kind = "number" if factor.is_number else "word"
        values: dict[str, object] = {"name": factor.name, "kind": kind}
        if factor.is_number:
            values["unit"] = factor.unit
        else:
            values["levels"] = list(factor.levels)
        text += "\n[[factors]]\n" + _lines(values)
    ground = {} if asked.sizes else {"ground": "plate"}
    text += "\n[defaults]\n" + _lines({"trials": asked.trials, **ground})
    varied: dict[str, Sequence[object]] = {"foot": asked.feet}
    if asked.sizes:
        varied["d50"] = asked.sizes
    varied |= {factor.name: factor.levels for factor in asked.factors}
    count = len(asked.inclines) * math.prod(map(len, varied.values()))
    if count > MOST_CELLS:
        raise SettingsError(
            f"{count} cells are more than {MOST_CELLS}.",
            hint="Name fewer levels. Nothing was written.",
        )
    name = _name_template(asked)
    for incline in asked.inclines:
        where = {"incline_deg": incline, "place": place_of(incline)}
        text += "\n[[crosses]]\n" + _lines({"name": name, **varied, **where})
    return text


def _name_template(asked: AskedDesign) -> str:
    """Return names that tell all cells apart in few characters.

    Raises:
        SettingsError: they cannot be short enough.
    """
    parts: list[tuple[str, Sequence[object], str]] = []
    if asked.sizes:
        parts.append(("d50", asked.sizes, "g"))
    for factor in asked.factors:
        form = "g" if factor.is_number else _shortest(factor.levels)
        parts.append((factor.name, factor.levels, form))
    if len(asked.feet) > 1:
        parts.append(("foot", asked.feet, _shortest(asked.feet)))
    if len(asked.inclines) > 1:
        parts.append(("incline_deg", asked.inclines, "+g"))
    longest = 1 + sum(
        max(len(format(level, form)) for level in levels) for _, levels, form in parts
    )
    if longest > _LONGEST:
        raise SettingsError(
            f"The names of the cells would have {longest} characters, more than "
            f"{_LONGEST}.",
            hint="Shorten words, or name fewer factors. Nothing was written.",
        )
    head = "G" if asked.sizes else "P"
    return head + "".join(f"{{{name}:{form}}}" for name, _, form in parts)


def _shortest(words: Sequence[object]) -> str:
    """Return the format of the shortest beginnings that tell words apart."""
    texts = [str(word) for word in words]
    longest = max(map(len, texts))
    for length in range(1, longest):
        if len({text[:length] for text in texts}) == len(set(texts)):
            return f".{length}"
    return f".{longest}"


def places_text(inclines: Sequence[float]) -> str:
    """Return the places of containers, for rig.toml; to be taught or corrected."""
    text = ""
    for incline in inclines:
        x, y, z = FAR_END
        high = round(z + max(incline, 0.0) * RISE, 4)
        text += (
            f"\n[places.{place_of(incline)}]  # traction teach {place_of(incline)}\n"
        )
        text += _lines(
            {"far_end": [x, y, high], "incline_deg": incline, "travel": TRAVEL}
        )
    return text


def feet_text(names: Sequence[str]) -> str:
    """Return feet that rig.toml does not have yet, to be weighed and measured."""
    body = {
        "mass": 0.45,
        "com": [0.01, 0.0, 0.062],
        "inertia": [4e-4, 5.5e-4, 4.5e-4],
        "sole": [0.01, 0.0, 0.112],
    }
    return "".join(
        f"\n[feet.{name}]  # weigh it: kg, m in frame 7, kg m^2\n{_lines(body)}"
        for name in names
    )
