"""Read and check rig.toml and matrix.toml, with errors that give advice."""

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
    """The resolved settings and their origin.

    Attributes:
        rig: rig.toml.
        matrix: matrix.toml.
        rig_text: text of rig.toml, for the recording.
        matrix_text: text of matrix.toml.
        origin: "shipped default" or the folder of the files.
        folder: folder of the files named in rig.toml.
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
        """Return a sentence for each unusual number."""
        files = ((self.rig_name, self.rig), ("matrix.toml", self.matrix))
        return [
            f"{file}: {words}"
            for file, section in files
            for words in unusual_numbers(section)
        ]

    def check_real(self) -> None:
        """Refuse numbers that only a simulated rig may have.

        Raises:
            SettingsError: a number exceeds the limit of a real arm.
        """
        beyond = beyond_real(self.rig)
        if beyond:
            raise SettingsError(
                f"{self.rig_name}: {beyond} on a real arm.",
                hint="Only a simulated one, on a busy computer, may have more. "
                "Nothing was started.",
            )

    def with_cad_gravity(self) -> "Settings":
        """Return the settings with the gravity of the drawings, for a calibration."""
        cad = self.rig.gravity.model_copy(update={"model": "cad"})
        return replace(self, rig=self.rig.model_copy(update={"gravity": cad}))

    def without_friction(self) -> "Settings":
        """Return the settings without friction compensation, for a calibration."""
        none = self.rig.friction.model_copy(update={"model": "none"})
        return replace(self, rig=self.rig.model_copy(update={"friction": none}))

    def with_foot_mass(self, mass: float) -> "Settings":
        """Return the settings with `mass` [kg] for all feet.

        Raises:
            SettingsError: rig.toml would be refused.
        """
        data = self.rig.model_dump(mode="json")
        for foot in data["feet"].values():
            foot["mass"] = mass
        rig = _validated(RigSettings, data, self.rig_text, "rig.toml")
        return replace(self, rig=rig)

    def with_row(self, row: TerrainRow) -> "Settings":
        """Return the settings with `row` replacing the row of that name."""
        rows = tuple(row if old.name == row.name else old for old in self._rows)
        matrix = self.matrix.model_copy(update={"terrains": rows})
        return replace(self, matrix=matrix)

    def without_sensor(self, foot: str, *, is_mounted: bool) -> "Settings":
        """Return the settings without the calibration of `foot`, for a new one.

        The mounting of the sensor is reset too, unless it `is_mounted` as before.
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
    """Load settings from `config`, a rig.toml, and the matrix.toml in its folder.

    Without `config`, or without matrix.toml, the shipped defaults are used.

    Raises:
        SettingsError: a file is missing, is no TOML, or has a wrong key or value.
    """
    rig_text, matrix_text = map(_shipped, ("rig.toml", "matrix.toml"))
    origin = SHIPPED
    if config is not None:
        rig_text = _read(config)
        origin = str(config)
        matrix_path = config.with_name("matrix.toml")
        if matrix_path.exists():
            matrix_text = _read(matrix_path)
    name = "rig.toml" if config is None else config.name
    folder = config.parent if config is not None else Path()
    rig = load_rig(rig_text, name, folder)
    matrix = load_matrix(matrix_text, rig)
    return Settings(rig, matrix, rig_text, matrix_text, origin, folder)


def load_untaught(
    config: Path | None, place: str, foot: str | None
) -> tuple[Settings, TerrainRow]:
    """Load settings with one terrain at a place that is not taught yet.

    A simulation takes the location of the container from rig.toml, or from the shipped
    matrix; a real arm needs none.

    Args:
        config: rig.toml; None = the shipped defaults. No matrix.toml is read.
        place: name of the place.
        foot: the mounted foot; None = the first of rig.toml.

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
    stated = rig.places.get(place, StatedPlace())
    row = TerrainRow(
        name=f"place-{place.replace('_', '-')}"[:24],
        foot=foot or next(iter(rig.feet)),
        far_end=stated.far_end or (0.70, 0.0, 0.12),
        heading_deg=stated.heading_deg or 0.0,
        incline_deg=stated.incline_deg or 0.0,
        travel=stated.travel or 0.45,
        trials=1,
        stones="small",
    )
    rig = rig.model_copy(update={"places": {}})
    matrix = MatrixSettings(terrains=(row,))
    origin = SHIPPED if config is None else str(config)
    return Settings(rig, matrix, text, "", origin, folder), row


def load_rig(text: str, name: str, folder: Path) -> RigSettings:
    """Parse a rig.toml, with its taught places.

    Args:
        text: its text.
        name: name of the file, for messages.
        folder: folder of the files that it names.

    Raises:
        SettingsError: no TOML, or it or a taught place has a wrong key or value.
    """
    rig = _rig_of(text, name)
    build_device(rig.ft_sensor)
    places = {key: _taught(key, place, folder) for key, place in rig.places.items()}
    return rig.model_copy(update={"places": places})


def _rig_of(text: str, name: str) -> RigSettings:
    return _validated(RigSettings, _read_table(text, name), text, name)


def _read_table(text: str, name: str) -> dict[str, Any]:
    """Return the content of a settings file without its version.

    Raises:
        SettingsError: no TOML, or another version.
    """
    table = _toml(text, name)
    if problem := format_problem(table.get("version")):
        raise SettingsError(
            f"{name} {problem}.",
            hint="traction init DIR writes one to edit. Nothing was started.",
        )
    return {key: value for key, value in table.items() if key != "version"}


def _taught(name: str, place: StatedPlace, folder: Path) -> StatedPlace:
    """Return a place with the values of its file."""
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
    """Parse a matrix.toml.

    Raises:
        SettingsError: no TOML, another version, or a wrong key or value, or a place or
            foot that rig.toml lacks.
    """
    file = _validated(DesignFile, _read_table(text, "matrix.toml"), text, "matrix.toml")
    return resolve_design(file, text, rig.places, tuple(rig.feet))


def read_foot(path: Path) -> FootSection:
    """Read a foot from a TOML file: mass, com, inertia, sole.

    Raises:
        SettingsError: the file cannot be read, or has a wrong key or value.
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
    """Validate the `data` of the file `name` with content `text` as a `model`."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise SettingsError(
            explain(model, name, text, error), hint="Nothing was started."
        ) from error
