"""rig.toml and matrix.toml: read, checked, with an error that says what to write."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from acquisition.errors import SettingsError
from acquisition.formats import format_problem
from acquisition.settings import parse_toml, read_text
from experiments.arguments import did_you_mean
from experiments.settings.design import DesignFile, resolve_design
from experiments.settings.explaining import explain
from experiments.settings.matrix import MatrixSettings, TerrainRow
from experiments.settings.numbers import beyond_real, unusual_numbers
from experiments.settings.places import StatedPlace, TaughtPlace
from experiments.settings.rig import FootSection, RigSettings
from experiments.settings.sensor import build_device

_M = TypeVar("_M", bound=BaseModel)
SHIPPED = "shipped default"


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

    @property
    def rig_name(self) -> str:
        """Name of the file of the rig, in messages."""
        return "rig.toml" if self.origin == SHIPPED else Path(self.origin).name

    def unusual(self) -> list[str]:
        """Return a sentence for each number that no sound rig has."""
        files = ((self.rig_name, self.rig), ("matrix.toml", self.matrix))
        return [
            f"{file}: {words}"
            for file, section in files
            for words in unusual_numbers(section)
        ]

    def check_real(self) -> None:
        """Refuse what only a simulated rig may have.

        Raises:
            SettingsError: a number is beyond what a real arm may have.
        """
        beyond = beyond_real(self.rig)
        if beyond:
            raise SettingsError(
                f"{self.rig_name}: {beyond} on a real arm.",
                hint="Only a simulated one, on a busy computer, may have more. "
                "Nothing was started.",
            )

    def by_cad(self) -> "Settings":
        """Return the same with the gravity of the drawings, for a calibration."""
        cad = self.rig.gravity.model_copy(update={"model": "cad"})
        return replace(self, rig=self.rig.model_copy(update={"gravity": cad}))

    def without_friction(self) -> "Settings":
        """Return the same without compensation of friction, for a calibration."""
        none = self.rig.friction.model_copy(update={"model": "none"})
        return replace(self, rig=self.rig.model_copy(update={"friction": none}))

    def with_foot_mass(self, mass: float) -> "Settings":
        """Return the same as if the feet had `mass` [kg] in rig.toml.

        Raises:
            SettingsError: rig.toml would be refused.
        """
        data = self.rig.model_dump(mode="json")
        for foot in data["feet"].values():
            foot["mass"] = mass
        rig = _validated(RigSettings, data, self.rig_text, "rig.toml")
        return replace(self, rig=rig)

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
        old = self.rig.feet[foot]
        feet = {**self.rig.feet, foot: old.model_copy(update=nothing)}
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
        known = [row.name for row in self.matrix.terrains]
        asked = did_you_mean(terrain, known)
        raise SettingsError(
            f"There is no terrain {terrain!r} in matrix.toml.",
            hint=f"{asked} Terrains: {' '.join(known)}. Nothing was started.".strip(),
        )


def load_settings(config: Path | None) -> Settings:
    """Return settings from `config`, a rig.toml with a matrix.toml beside it.

    Without `config` the shipped defaults are used; a missing matrix.toml too.

    Raises:
        SettingsError: a file is missing, no TOML, or holds a wrong key or value.
    """
    rig_text, matrix_text = map(_shipped, ("rig.toml", "matrix.toml"))
    origin = SHIPPED
    if config is not None:
        rig_text = _read(config)
        origin = str(config)
        beside = config.with_name("matrix.toml")
        if beside.exists():
            matrix_text = _read(beside)
    name = "rig.toml" if config is None else config.name
    folder = config.parent if config is not None else Path()
    rig = load_rig(rig_text, name, folder)
    matrix = load_matrix(matrix_text, rig)
    return Settings(rig, matrix, rig_text, matrix_text, origin, folder)


def load_unplaced(
    config: Path | None, place: str, foot: str | None
) -> tuple[Settings, TerrainRow]:
    """Return settings with one terrain at a place that nobody has measured yet.

    Where the container of a simulation stands follows from the numbers that rig.toml
    has of the place, or is that of the shipped matrix; a real arm needs none.

    Args:
        config: rig.toml; None = the shipped defaults. No matrix.toml is read.
        place: its name.
        foot: that is mounted; None = the first of rig.toml.

    Raises:
        SettingsError: rig.toml has a wrong key or value, or no such foot.
    """
    text = _shipped("rig.toml") if config is None else _read(config)
    folder = Path() if config is None else config.parent
    name = "rig.toml" if config is None else config.name
    rig = _rig_of(text, name)
    build_device(rig.ft_sensor)
    if foot is not None and foot not in rig.feet:
        raise SettingsError(
            f"There is no foot {foot!r} in {name}.",
            hint=f"Feet: {', '.join(rig.feet)}. Nothing was started.",
        )
    known = rig.places.get(place, StatedPlace())
    row = TerrainRow(
        name=f"place-{place.replace('_', '-')}"[:24],
        foot=foot or next(iter(rig.feet)),
        far_end=known.far_end or (0.70, 0.0, 0.12),
        heading_deg=known.heading_deg or 0.0,
        incline_deg=known.incline_deg or 0.0,
        travel=known.travel or 0.45,
        trials=1,
        stones="small",
    )
    rig = rig.model_copy(update={"places": {}})
    matrix = MatrixSettings(terrains=(row,))
    origin = SHIPPED if config is None else str(config)
    return Settings(rig, matrix, text, "", origin, folder), row


def load_rig(text: str, name: str, folder: Path) -> RigSettings:
    """Return a rig.toml with the places that were taught.

    Args:
        text: its text.
        name: of the file, in messages.
        folder: where the files are that it names.

    Raises:
        SettingsError: no TOML, or it or a taught place has a wrong key or value.
    """
    rig = _rig_of(text, name)
    build_device(rig.ft_sensor)
    places = {key: _taught(key, each, folder) for key, each in rig.places.items()}
    return rig.model_copy(update={"places": places})


def _rig_of(text: str, name: str) -> RigSettings:
    return _validated(RigSettings, _read_table(text, name), text, name)


def _read_table(text: str, name: str) -> dict[str, Any]:
    """Return what a settings file states beside its version.

    Raises:
        SettingsError: no TOML, or of another version.
    """
    table = _toml(text, name)
    if problem := format_problem(table.get("version")):
        raise SettingsError(
            f"{name} {problem}.",
            hint="traction init DIR writes one to be edited. Nothing was started.",
        )
    return {key: value for key, value in table.items() if key != "version"}


def _taught(name: str, place: StatedPlace, folder: Path) -> StatedPlace:
    """Return a place with what its file states."""
    if place.taught is None:
        return place
    if place.has_numbers:
        raise SettingsError(
            f"rig.toml: places.{name} was taught and has numbers of its own.",
            hint="Remove the numbers, or the line taught. Nothing was started.",
        )
    text = _read(folder / place.taught, f"Run traction teach {name}.")
    try:
        taught = TaughtPlace.parse(text)
    except ValueError as error:
        raise SettingsError(
            f"{place.taught} is no place: {error}.",
            hint=f"Run traction teach {name} again. Nothing was started.",
        ) from error
    if taught.place != name:
        raise SettingsError(
            f"{place.taught} is of place {taught.place}, not of {name}.",
            hint=f"Run traction teach {name}, or name its file. Nothing was started.",
        )
    calibration = {"calibration": place.calibration}
    return taught.as_place(place.taught).model_copy(update=calibration)


def load_matrix(text: str, rig: RigSettings) -> MatrixSettings:
    """Return the rows of a matrix.toml.

    Raises:
        SettingsError: no TOML, of another version, or a wrong key or value, or one that
            the rig has not.
    """
    file = _validated(DesignFile, _read_table(text, "matrix.toml"), text, "matrix.toml")
    return resolve_design(file, text, rig.places, tuple(rig.feet))


def read_foot(path: Path) -> FootSection:
    """Return the foot that a TOML file of its own describes: mass, com, inertia, sole.

    Raises:
        SettingsError: it cannot be read, or holds a wrong key or value.
    """
    text = _read(path, "Name a foot of rig.toml, or a file with mass, com, inertia.")
    return _parse(FootSection, text, path.name)


def _shipped(name: str) -> str:
    return (resources.files("experiments.data") / name).read_text()


def _read(path: Path, hint: str = "Name a rig.toml with --config.") -> str:
    try:
        return read_text(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingsError(
            f"{path} cannot be read ({reason}).", hint=f"{hint} Nothing was started."
        ) from error


def _parse(model: type[_M], text: str, name: str) -> _M:
    return _validated(model, _toml(text, name), text, name)


def _toml(text: str, name: str) -> dict[str, Any]:
    try:
        return parse_toml(text)
    except ValueError as error:
        raise SettingsError(f"{name}: {error}.", hint="Nothing was started.") from error


def _validated(model: type[_M], data: object, text: str, name: str) -> _M:
    """Return the `data` of a file `name` with `text` as a `model`."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise SettingsError(
            explain(model, name, text, error), hint="Nothing was started."
        ) from error
