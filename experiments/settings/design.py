"""matrix.toml: factors, defaults, cells and crosses, resolved into rows.

A cell states every factor, or "-" if one does not apply; a cross stands for every
combination of its lists. The location of a cell is a place of rig.toml, or its own
far_end.
"""

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, cast

from pydantic import Field, ValidationError

from acquisition.errors import SettingsError
from acquisition.settings import File, Number, SettingsSection
from analysis.data.terrain_kinds import Value, ground_of, stones_of
from experiments.arguments import nearest
from experiments.settings.explaining import explain, line_of
from experiments.settings.matrix import (
    MAX_FACTORS,
    RESET,
    Angles,
    CellName,
    Design,
    DesignFactor,
    FarEnd,
    FootName,
    GroundWord,
    Heading,
    Incline,
    MatrixSettings,
    PlaceName,
    Push,
    Tasks,
    TerrainRow,
    Travel,
    Trials,
)
from experiments.settings.places import StatedPlace

ABSENT = "-"  # a factor that does not apply
MAX_CELLS = 400
_SAME_INCLINE = 3.0  # degrees, tolerance between a cell and its taught place
_NOTHING = "Nothing was started."
_FIELD = re.compile(r"\{([a-z][a-z0-9_]*)(?::([^{}]*))?\}")
_FORM = re.compile(r"[+-]?0?\d{0,2}(?:\.\d{1,2})?[dfgs]?")
_RESERVED = frozenset(
    (
        *("kind", "session", "operator", "terrain", "stones", "stone_size", "tread"),
        *("simulated", "seed", "notes", "trial", "attempt", "factors", "ground"),
        *("t", "v_t", "f_n", "f_t", "unit", "version"),
    )
)


# parameters of fakes.ground, for simulated rigs only
_Parameter = Literal[
    "J0",
    "k_J",
    "k_n",
    "run",
    "k_run",
    "disp",
    "gap",
    "s_inf",
    "k_w",
    "sigma_k",
    "cop",
    "K_t",
    "mu_s",
    "mu_k",
    "b",
]
_Multiple = Annotated[Number, Field(ge=0.1, le=10)]
_Effects = dict[str, dict[str, dict[_Parameter, _Multiple]]]


class _Cell(SettingsSection):
    """Keys of a cell other than its factors, with their defaults."""

    name: CellName = Field(examples=["G37W-10"])
    foot: FootName = Field(examples=["tread"])
    ground: GroundWord | None = Field(default=None, examples=["stones"])
    incline_deg: Incline | None = Field(default=None, examples=[-10.0])
    heading_deg: Heading | None = Field(default=None, examples=[0.0])
    push_deg: Push = Field(default=0, examples=[180])
    place: PlaceName | None = Field(default=None, examples=["bay2"])
    far_end: FarEnd | None = Field(default=None, examples=[[0.70, 0.0, 0.12]])
    travel: Travel | None = Field(default=None, examples=[0.45])
    trials: Trials = Field(default=10, examples=[10])
    reset: Tasks = RESET
    start_q: Angles | None = None
    calibration: File | None = None


_KEYS = tuple(_Cell.model_fields)
_VARIED = frozenset(
    ("foot", "ground", "incline_deg", "heading_deg", "push_deg", "place", "trials")
)


class DesignFile(SettingsSection):
    """Content of matrix.toml, cells and crosses not validated yet."""

    factors: tuple[DesignFactor, ...] = Field(default=(), max_length=MAX_FACTORS)
    design: Design = Design()
    defaults: dict[str, Any] = Field(default_factory=dict[str, Any])
    cells: tuple[dict[str, Any], ...] = Field(default=(), max_length=MAX_CELLS)
    crosses: tuple[dict[str, Any], ...] = Field(default=(), max_length=60)
    simulate: _Effects = Field(default_factory=_Effects)


@dataclass(frozen=True, slots=True)
class _Stated:
    """One cell as stated, with its table.

    Attributes:
        values: values of all keys, including defaults.
        table: name of its table in the file, e.g. "cells[3]".
        is_of_cross: whether it is a combination of a cross.
    """

    values: Mapping[str, Any]
    table: str
    is_of_cross: bool = False


def resolve_design(
    file: DesignFile, text: str, places: Mapping[str, StatedPlace], feet: Sequence[str]
) -> MatrixSettings:
    """Resolve a file into rows.

    Args:
        file: the file.
        text: its text, for line numbers in messages.
        places: places of rig.toml, by name.
        feet: names of the feet of rig.toml.

    Raises:
        SettingsError: a key or value is wrong, missing or duplicate, or there are too
            many cells.
    """
    return _Resolver(file, text, places, feet).matrix()


class _Resolver:
    """Resolves a file into rows, or reports the line of its first error."""

    def __init__(
        self,
        file: DesignFile,
        text: str,
        places: Mapping[str, StatedPlace],
        feet: Sequence[str],
    ) -> None:
        self._file, self._text = file, text
        self._places, self._feet = places, feet
        self._factors = {factor.name: factor for factor in file.factors}

    def matrix(self) -> MatrixSettings:
        self._check_factors()
        stated = [*self._own(), *self._crossed()]
        if not stated:
            raise self._error("", "there are no [[cells]] and no [[crosses]]")
        rows = tuple(map(self._row, stated))
        named: dict[str, _Stated] = {}
        for row, cell in zip(rows, stated, strict=True):
            if row.name in named:
                twice = f"name {row.name!r} occurs twice"
                if cell.is_of_cross or named[row.name].is_of_cross:
                    twice += ": name every factor of the cross, e.g. {d50:g}"
                raise self._error(cell.table, twice)
            named[row.name] = cell
        return MatrixSettings(
            terrains=rows, factors=self._file.factors, design=self._file.design
        )

    def _check_factors(self) -> None:
        names = [factor.name for factor in self._file.factors]
        for number, name in enumerate(names):
            table = f"factors[{number}]"
            if name in _RESERVED or name in _KEYS:
                raise self._error(table, f"{name} is a name that Traction itself uses")
            if name in names[:number]:
                raise self._error(table, f"factor {name} occurs twice")
        for key in self._file.design.block_by:
            if key not in self._factors and key not in _VARIED:
                raise self._error(
                    "design", f"block_by names {key!r}, which no cell states"
                )
        for name, by_word in self._file.simulate.items():
            factor = self._factors.get(name)
            levels = factor.levels if factor is not None else ()
            for word in by_word:
                if word not in levels:
                    raise self._error(
                        f"simulate.{name}.{word}",
                        f"simulate.{name}.{word} is no word of a factor",
                    )

    def _own(self) -> Iterator[_Stated]:
        for number, cell in enumerate(self._file.cells):
            yield _Stated({**self._file.defaults, **cell}, f"cells[{number}]")

    def _crossed(self) -> Iterator[_Stated]:
        """Yield every combination of the crosses.

        Raises:
            SettingsError: there are too many.
        """
        count = len(self._file.cells)
        for number, cross in enumerate(self._file.crosses):
            table = f"crosses[{number}]"
            values = {**self._file.defaults, **cross}
            lists = {
                key: cast("list[Any]", value)
                for key, value in values.items()
                if isinstance(value, list) and (key in self._factors or key in _VARIED)
            }
            if empty := next(
                (key for key, levels in lists.items() if not levels), None
            ):
                raise self._error(f"{table}.{empty}", f"{empty} is an empty list")
            count += math.prod(map(len, lists.values()))
            if count > MAX_CELLS:
                raise self._error(table, f"more than {MAX_CELLS} cells")
            for combination in itertools.product(*lists.values()):
                chosen = {**values, **dict(zip(lists, combination, strict=True))}
                chosen["name"] = self._name(chosen, table)
                yield _Stated(chosen, table, is_of_cross=True)

    def _name(self, values: Mapping[str, Any], table: str) -> str:
        """Return the name of one combination of a cross."""
        template = values.get("name")
        if not isinstance(template, str) or len(template) > 200:
            raise self._error(table, 'name is missing, e.g. name = "G{d50:g}{foot:.1}"')

        def format_field(match: re.Match[str]) -> str:
            key, form = match[1], match[2] or ""
            if key not in values or not isinstance(values[key], str | int | float):
                raise self._error(table, f"name has {{{key}}}, which it does not state")
            value = values[key]
            if isinstance(value, float) and value.is_integer() and form.endswith("d"):
                value = int(value)
            if not _FORM.fullmatch(form):
                raise self._error(table, f"name has an odd form {form!r} of {key}")
            try:
                return format(value, form)
            except ValueError as error:
                raise self._error(
                    table, f"name cannot write {key} = {value!r} as {form!r}"
                ) from error

        texts = {
            match.start(): format_field(match) for match in _FIELD.finditer(template)
        }
        ends = {
            match.end(): texts[match.start()] for match in _FIELD.finditer(template)
        }
        for start in ends.keys() & texts.keys():
            if ends[start][-1:].isdigit() and texts[start][:1].isdigit():
                raise self._error(
                    table,
                    f"name {template!r} joins two numbers without a mark between, so "
                    "that 1 and 11 look like 11 and 1",
                )
        name = _FIELD.sub(format_field, template)
        if "{" in name or "}" in name:
            raise self._error(table, f"name {template!r} has an odd brace")
        return name

    def _row(self, stated: _Stated) -> TerrainRow:
        table = stated.table
        unknown = [
            k for k in stated.values if k not in _KEYS and k not in self._factors
        ]
        if unknown:
            key = unknown[0]
            meant = nearest(key, [*_KEYS, *self._factors])
            asked = f" - did you mean {meant}?" if meant else ""
            raise self._error(
                f"{table}.{key}",
                f"{key} is neither a setting of a cell nor a factor{asked}",
            )
        fixed = {k: v for k, v in stated.values.items() if k in _KEYS}
        try:
            cell = _Cell.model_validate(fixed)
        except ValidationError as error:
            raise SettingsError(
                explain(_Cell, "matrix.toml", self._text, error, inside=table),
                hint=_NOTHING,
            ) from error
        return self._placed(cell, self._values(cell.name, stated), table)

    def _values(self, name: str, stated: _Stated) -> dict[str, Value]:
        """Return the values of the factors of a cell."""
        values: dict[str, Value] = {}
        for factor in self._file.factors:
            key, table = factor.name, f"{stated.table}.{factor.name}"
            if key not in stated.values:
                raise self._error(
                    stated.table,
                    f"{name} does not state {key}; write "
                    f'{key} = "{ABSENT}" where it does not apply',
                )
            given: object = stated.values[key]
            if isinstance(given, bool) or not isinstance(given, str | int | float):
                raise self._error(table, f"{name}: {key} is no number and no word")
            value: Value = None if given == ABSENT else given
            if isinstance(value, int):
                value = float(value)
            if fault := factor.check(value):
                raise self._error(
                    table, f"{name}: {key} = {given!r} - expected {fault}"
                )
            values[key] = value
        return values

    def _placed(self, cell: _Cell, factors: dict[str, Value], table: str) -> TerrainRow:
        """Return the row of a cell, located by its place or its own far_end."""
        if cell.foot not in self._feet:
            raise self._error(
                f"{table}.foot",
                f"{cell.name}: foot = {cell.foot!r} - expected one of rig.toml: "
                f"{', '.join(self._feet)}",
            )
        place = StatedPlace() if cell.place is None else self._place(cell, table)
        if cell.place is not None and cell.far_end is not None:
            raise self._error(
                table, f"{cell.name} states both place and far_end; one is enough"
            )
        far_end = cell.far_end or place.far_end
        travel = place.travel if cell.travel is None else cell.travel
        if far_end is None or travel is None:
            what = "travel" if far_end else "place, e.g. bay1, and no far_end"
            raise self._error(table, f"{cell.name} states no {what}")
        return TerrainRow(
            name=cell.name,
            foot=cell.foot,
            far_end=far_end,
            heading_deg=_first(cell.heading_deg, place.heading_deg, 0.0),
            travel=travel,
            trials=cell.trials,
            reset=cell.reset,
            calibration=cell.calibration or place.calibration,
            stones=self._stones(cell, factors, table),
            incline_deg=self._incline(cell, place, table),
            push_deg=cell.push_deg,
            start_q=cell.start_q or place.start,
            place=cell.place,
            taught=place.taught,
            factors=factors,
            simulate=self._effects(factors),
        )

    def _effects(self, factors: Mapping[str, Value]) -> dict[str, float]:
        """Return the factors by which a cell scales the simulated ground."""
        multiples: dict[str, float] = {}
        for name, by_word in self._file.simulate.items():
            for parameter, multiple in by_word.get(str(factors.get(name)), {}).items():
                multiples[parameter] = multiples.get(parameter, 1.0) * multiple
        return multiples

    def _place(self, cell: _Cell, table: str) -> StatedPlace:
        place = self._places.get(cell.place or "")
        if place is None:
            names = ", ".join(self._places) or "none"
            raise self._error(
                f"{table}.place",
                f"{cell.name}: place = {cell.place!r} is not in rig.toml, which has: "
                f"{names}. Teach it: traction teach {cell.place}",
            )
        return place

    def _incline(self, cell: _Cell, place: StatedPlace, table: str) -> float:
        """Return the incline of a cell; refuses one that differs from its place."""
        if cell.incline_deg is None:
            return _first(place.incline_deg, None, 0.0)
        taught = place.incline_deg
        if taught is not None and abs(taught - cell.incline_deg) > _SAME_INCLINE:
            raise self._error(
                table,
                f"{cell.name}: incline_deg = {cell.incline_deg:g}, but place "
                f"{cell.place} stands at {taught:g} degrees",
            )
        return cell.incline_deg

    def _stones(self, cell: _Cell, factors: Mapping[str, Value], table: str) -> str:
        """Return the size of the stones as recordings state it."""
        d50 = factors.get("d50")
        size = None if isinstance(d50, str) else d50
        if cell.ground is not None:
            return stones_of(cell.ground, size)
        if "d50" not in factors:
            raise self._error(
                table,
                f"{cell.name} has no factor d50, so it needs ground = "
                '"stones", "plate" or "fine"',
            )
        return stones_of(ground_of(size), size)

    def _error(self, name: str, what: str) -> SettingsError:
        line = line_of(self._text, name) if name else None
        where = f" (line {line})" if line else ""
        return SettingsError(f"matrix.toml: {what}{where}.", hint=_NOTHING)


def _first(own: float | None, other: float | None, default: float) -> float:
    """Return the first stated number, or the default."""
    return next((value for value in (own, other) if value is not None), default)
