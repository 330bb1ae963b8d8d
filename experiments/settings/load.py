"""rig.toml and matrix.toml: read, checked, with an error that says what to write."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from acquisition import SettingsError, parse_toml, read_text
from experiments.settings.matrix import MatrixSettings, TerrainRow
from experiments.settings.rig import FootSection, RigSettings
from experiments.settings.sensor import build_device

_M = TypeVar("_M", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class Settings:
    """The resolved settings and where they came from.

    Attributes:
        rig: rig.toml.
        matrix: matrix.toml.
        rig_text: text of rig.toml, for the recording.
        matrix_text: text of matrix.toml.
        origin: "shipped default" or the folder of the files.
        folder: where the files are that rig.toml names.
        calibrations: texts of the calibration files that were applied, by name.
    """

    rig: RigSettings
    matrix: MatrixSettings
    rig_text: str
    matrix_text: str
    origin: str
    folder: Path
    calibrations: Mapping[str, str] = field(default_factory=dict[str, str])

    def by_cad(self) -> "Settings":
        """Return the same with the gravity of the drawings, for a calibration."""
        cad = self.rig.gravity.model_copy(update={"model": "cad"})
        return replace(self, rig=self.rig.model_copy(update={"gravity": cad}))

    def without_friction(self) -> "Settings":
        """Return the same without compensation of friction, for a calibration."""
        none = self.rig.friction.model_copy(update={"model": "none"})
        return replace(self, rig=self.rig.model_copy(update={"friction": none}))

    def with_row(self, row: TerrainRow) -> "Settings":
        """Return the same with `row` in place of the one of its name."""
        rows = tuple(row if old.name == row.name else old for old in self._rows)
        matrix = self.matrix.model_copy(update={"terrains": rows})
        return replace(self, matrix=matrix)

    def without_sensor(self, foot: str, *, is_mounted: bool) -> "Settings":
        """Return the same without what was measured of `foot`, for a calibration.

        The mounting of the sensor goes too, unless it `is_mounted` as it was.
        """
        nothing = {"calibration": None}
        old = self.rig.feet.tread if foot == "tread" else self.rig.feet.bare
        feet = self.rig.feet.model_copy(update={foot: old.model_copy(update=nothing)})
        changed: dict[str, object] = {"feet": feet}
        if not is_mounted:
            changed["ft_sensor"] = self.rig.ft_sensor.model_copy(update=nothing)
        return replace(self, rig=self.rig.model_copy(update=changed))

    @property
    def _rows(self) -> tuple[TerrainRow, ...]:
        return self.matrix.terrains

    def row(self, terrain: str) -> TerrainRow:
        """Return the matrix row of `terrain`.

        Raises:
            SettingsError: there is no such row.
        """
        for row in self.matrix.terrains:
            if row.name == terrain:
                return row
        known = " ".join(row.name for row in self.matrix.terrains)
        raise SettingsError(
            f"There is no terrain {terrain!r} in matrix.toml.",
            hint=f"Terrains: {known}. Nothing was started.",
        )


def load_settings(config: Path | None) -> Settings:
    """Return settings from `config`, a rig.toml with a matrix.toml beside it.

    Without `config` the shipped defaults are used; a missing matrix.toml too.

    Raises:
        SettingsError: a file is missing, no TOML, or holds a wrong key or value.
    """
    shipped = resources.files("experiments.data")
    rig_text = (shipped / "rig.toml").read_text()
    matrix_text = (shipped / "matrix.toml").read_text()
    origin = "shipped default"
    if config is not None:
        rig_text = _read(config)
        origin = str(config)
        beside = config.with_name("matrix.toml")
        if beside.exists():
            matrix_text = _read(beside)
    rig = _parse(RigSettings, rig_text, "rig.toml")
    build_device(rig.ft_sensor)
    matrix = _parse(MatrixSettings, matrix_text, "matrix.toml")
    names = [row.name for row in matrix.terrains]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise SettingsError(
            f"matrix.toml: terrain {twice[0]!r} stands there twice.",
            hint="Every row needs a name of its own. Nothing was started.",
        )
    folder = config.parent if config is not None else Path()
    return Settings(rig, matrix, rig_text, matrix_text, origin, folder)


def read_foot(path: Path) -> FootSection:
    """Return the foot that a TOML file of its own describes: mass, com, inertia, sole.

    Raises:
        SettingsError: it cannot be read, or holds a wrong key or value.
    """
    text = _read(path, "Name a foot of rig.toml, or a file with mass, com, inertia.")
    return _parse(FootSection, text, path.name)


def _read(path: Path, hint: str = "Name a rig.toml with --config.") -> str:
    try:
        return read_text(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingsError(
            f"{path} cannot be read ({reason}).", hint=f"{hint} Nothing was started."
        ) from error


def _parse(model: type[_M], text: str, name: str) -> _M:
    try:
        data = parse_toml(text)
    except ValueError as error:
        raise SettingsError(f"{name}: {error}.", hint="Nothing was started.") from error
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise SettingsError(
            explain(model, name, error), hint="Nothing was started."
        ) from error


_NUMBERS: dict[object, str] = {int: "a whole number", float: "a number"}
_BOUNDS = (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<="))


def explain(model: type[BaseModel], name: str, error: ValidationError) -> str:
    """Return what is wrong with file `name`, which should have been a `model`.

    Of several errors the first is explained.
    """
    first = error.errors()[0]
    location = _locate(model, first["loc"])
    place = f"{name}: {location.place}"
    if first["type"] == "missing":
        return f"{place} is missing{location.example}."
    if first["type"] == "extra_forbidden":
        return f"{place} {_refusal(location, str(first['loc'][-1]))}."
    if first["type"] == "union_tag_not_found":
        return f"{place}.kind is missing, e.g. {_kinds(location.kinds)}."
    if first["type"] == "union_tag_invalid":
        got = first.get("ctx", {}).get("tag")
        return f'{place}.kind = "{got}" - expected {_kinds(location.kinds)}.'
    got = first["input"]
    shown = f'"{got:.80}"' if isinstance(got, str) else f"{got!r:.80}"
    expected = _expected(location.field, first["msg"])
    return f"{place} = {shown} - expected {expected}{location.example}."


@dataclass(frozen=True, slots=True)
class _Location:
    """A place in a settings file.

    Attributes:
        place: its dotted name as a person writes it.
        field: what should stand there; None where nothing is known.
        kinds: the sections that a `kind` chooses between, on the way to it; or none.
        kind: the chosen one.
    """

    place: str
    field: FieldInfo | None
    kinds: Mapping[str, type[BaseModel]]
    kind: str

    @property
    def example(self) -> str:
        """An example of the field for the end of a sentence; or nothing."""
        examples = self.field.examples if self.field else None
        return f", e.g. {examples[0]}" if examples else ""


def _locate(model: type[BaseModel], location: tuple[int | str, ...]) -> _Location:
    """Follow the `location` of an error; a kind stands in it like a table."""
    current: type[BaseModel] | None = model
    field: FieldInfo | None = None
    kinds: Mapping[str, type[BaseModel]] = {}
    place = kind = ""
    for part in location:
        if isinstance(part, int):
            place += f"[{part}]"
        elif current is None and part in kinds and not kind:
            kind, current = part, kinds[part]
        else:
            place += f".{part}"
            field = current.model_fields.get(part) if current else None
            sections = _sections_of(field.annotation) if field else []
            current = sections[0] if len(sections) == 1 else None
            if len(sections) > 1:
                kinds = {_kind_of(section): section for section in sections}
    return _Location(place.lstrip("."), field, kinds, kind)


def _sections_of(annotation: Any) -> list[type[BaseModel]]:  # noqa: ANN401
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [
        section for inner in get_args(annotation) for section in _sections_of(inner)
    ]


def _kind_of(section: type[BaseModel]) -> str:
    return str(get_args(section.model_fields["kind"].annotation)[0])


def _kinds(kinds: Mapping[str, type[BaseModel]]) -> str:
    *others, last = (f"'{kind}'" for kind in kinds)
    return f"{', '.join(others)} or {last}"


def _refusal(location: _Location, option: str) -> str:
    """Return why there is no such `option`; that of another kind has a name."""
    others = [kind for kind, s in location.kinds.items() if option in s.model_fields]
    if not others:
        return "is no setting Traction knows"
    names = " and ".join(f'"{kind}"' for kind in others)
    return f'belongs to kind {names}, this is a "{location.kind}"'


def _expected(field: FieldInfo | None, otherwise: str) -> str:
    """Return what a number should be, with its bounds; else what pydantic says."""
    kind = _NUMBERS.get(field.annotation) if field else None
    if field is None or kind is None:
        return otherwise.removeprefix("Input should be ")
    bounds = [
        f"{sign} {getattr(constraint, name)}"
        for constraint in field.metadata
        for name, sign in _BOUNDS
        if hasattr(constraint, name)
    ]
    return f"{kind} {' and '.join(bounds)}".rstrip()
