"""Apply the calibrations that settings name: sensor, feet, containers."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import ValidationError

from acquisition.errors import SettingsError
from acquisition.settings import parse_toml, read_text
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow
from experiments.settings.places import TaughtPlace
from experiments.settings.rig import RigSettings
from ft_sensor.calibration.files import terrain_from_toml, terrain_metadata
from ft_sensor.calibration.fit import ContainerFit, check_residual, check_terrain
from ft_sensor.calibration.sensor_file import SensorCalibration, sensor_from_toml
from ft_sensor.payload import TerrainFrame

NOTHING = "Nothing was started."
PREFIX = "calibration:"  # prefix of file names among the texts
FORCED = "forced"  # key of a container calibration that was forced


def read_calibration(path: Path, what: str, instead: str) -> str:
    """Return the text of the calibration at `path`.

    Args:
        path: path of the file.
        what: calibrated quantity, as in "traction calibrate WHAT".
        instead: advice how to do without it.

    Raises:
        SettingsError: the file cannot be read.
    """
    try:
        return read_text(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingsError(
            f"The {what} calibration {path} cannot be read ({reason}).",
            hint=f"Make it with: traction calibrate {what}. Or {instead}. {NOTHING}",
        ) from error


def check_kind(
    name: str, *, is_of_simulation: bool, is_simulated: bool, instead: str
) -> None:
    """Refuse a calibration of a simulated rig for a real one, and vice versa.

    Args:
        name: name of the file.
        is_of_simulation: whether it was measured on a simulated rig.
        is_simulated: whether the present rig is simulated.
        instead: advice how to do without it.

    Raises:
        SettingsError: the kinds differ.
    """
    if is_of_simulation == is_simulated:
        return
    kinds = "simulated", "real"
    theirs, ours = kinds if is_of_simulation else kinds[::-1]
    raise SettingsError(
        f"{name} was measured on a {theirs} arm, this is a {ours} one.",
        hint=f"{instead[0].upper()}{instead[1:]}, or name another file. {NOTHING}",
    )


def fault_of(check: Callable[[], None]) -> str:
    """Return the message of a failed check, "" if it passes."""
    try:
        check()
    except SettingsError as error:
        return error.message
    return ""


def unfit(name: str, fault: str, what: str, instead: str) -> SettingsError:
    """Return the error for a calibration that its command would have refused."""
    return SettingsError(
        f"{name} is no calibration to use. {fault}",
        hint=f"Run traction calibrate {what} again, or {instead}. {NOTHING}",
    )


_M = TypeVar("_M", RigSettings, TerrainRow)
_INSTEAD = "remove the line calibration = {name!r}"


def with_calibrations(settings: Settings, *, is_simulated: bool) -> Settings:
    """Return the settings with the values of their calibrations.

    A sensor calibration sets the mounting, and mass and centre of the mounted foot; a
    foot's own calibration takes precedence. A container calibration sets the frame of
    its row. A simulation is built from the settings without calibrations.

    Raises:
        SettingsError: a file cannot be read, is no calibration, is of another foot or
            terrain, or of a simulated rig for a real one or vice versa.
    """
    reader = _Reader(settings, is_simulated=is_simulated)
    rig = reader.rig(settings.rig)
    sharing: dict[str, set[str]] = {}
    for row in settings.matrix.terrains:
        sharing.setdefault(row.place or row.name, set()).add(row.name)
    rows = tuple(
        reader.row(row, sharing[row.place or row.name])
        for row in settings.matrix.terrains
    )
    matrix = settings.matrix.model_copy(update={"terrains": rows})
    return replace(settings, rig=rig, matrix=matrix, calibrations=reader.texts)


class _Reader:
    """Reads each file once and keeps its text for the recordings."""

    def __init__(self, settings: Settings, *, is_simulated: bool) -> None:
        self.texts: dict[str, str] = {}
        self._folder = settings.folder
        self._is_simulated = is_simulated

    def rig(self, rig: RigSettings) -> RigSettings:
        """Return rig.toml with its sensor's and feet's calibrations."""
        values = rig.model_dump()
        mount, feet = values["ft_sensor"], values["feet"]
        if rig.ft_sensor.calibration is not None:
            stored = self._sensor(rig.ft_sensor.calibration, "sensor", None)
            mount["angle_deg"] = float(np.degrees(stored.fit.angle))
            mount["sign"] = int(stored.fit.sign)
            if stored.foot in feet:
                feet[stored.foot].update(_body(stored, rig.ft_sensor.height))
        for name, section in rig.feet.items():
            if section.calibration is not None:
                stored = self._sensor(section.calibration, "foot", name)
                feet[name].update(_body(stored, rig.ft_sensor.height))
        return _checked(RigSettings, values)

    def row(self, row: TerrainRow, sharing: Collection[str]) -> TerrainRow:
        """Return a row of the matrix with the calibrated frame of its container.

        Args:
            row: the row.
            sharing: names of the terrains at its place, including its own.
        """
        if row.taught is not None:
            instead = f"remove [places.{row.place}]"
            text = read_calibration(self._folder / row.taught, "terrain", instead)
            taught = TaughtPlace.parse(text)
            self._check_kind(row.taught, is_of_simulation=taught.simulated)
            self.texts[f"{PREFIX}{row.taught}"] = text
        name = row.calibration
        if name is None:
            return row
        text = self._read(name, f"terrain --terrain {row.name}")
        terrain, frame = terrain_from_toml(text)
        if terrain not in sharing:
            raise _mismatch(name, f"terrain {terrain}", f"terrain {row.name}")
        facts = terrain_metadata(text)
        self._check_kind(name, is_of_simulation=facts.get("simulated") == "true")
        fault = _terrain_fault(frame, row)
        if fault and facts.get(FORCED) != "true":
            raise unfit(name, fault, "terrain", _INSTEAD.format(name=name))
        measured = {
            "incline_deg": float(np.degrees(frame.incline)),
            "heading_deg": float(np.degrees(frame.heading)),
            "far_end": frame.start,
            "travel": frame.travel,
        }
        return _checked(TerrainRow, {**row.model_dump(), **measured})

    def _sensor(self, name: str, what: str, foot: str | None) -> SensorCalibration:
        stored = sensor_from_toml(self._read(name, what), name)
        self._check_kind(name, is_of_simulation=stored.is_simulated)
        if foot is not None and stored.foot != foot:
            raise _mismatch(name, f"foot {stored.foot}", f"foot {foot}")
        fault = _sensor_fault(stored)
        if fault and not stored.is_forced:
            raise unfit(name, fault, what, _INSTEAD.format(name=name))
        return stored

    def _read(self, name: str, what: str) -> str:
        instead = _INSTEAD.format(name=name)
        text = read_calibration(self._folder / name, what, instead)
        self.texts[f"{PREFIX}{name}"] = text
        return text

    def _check_kind(self, name: str, *, is_of_simulation: bool) -> None:
        check_kind(
            name,
            is_of_simulation=is_of_simulation,
            is_simulated=self._is_simulated,
            instead=_INSTEAD.format(name=name),
        )


def forced_words(settings: Settings) -> list[str]:
    """Return a sentence for each sensor's or foot's calibration that was forced."""
    words: list[str] = []
    for key, text in settings.calibrations.items():
        name = key.removeprefix(PREFIX)
        if _is_of_place(text):
            continue
        if "readings" not in text:  # a container
            if terrain_metadata(text).get(FORCED) == "true":
                words.append(f"{name} was forced: its incline is not the matrix's.")
        elif fault := _sensor_fault(sensor_from_toml(text, name)):
            words.append(f"{name} was forced. {fault}")
    return words


def _is_of_place(text: str) -> bool:
    return "place" in parse_toml(text)


def _sensor_fault(stored: SensorCalibration) -> str:
    return fault_of(lambda: check_residual(stored.fit, is_forced=False))


def _terrain_fault(frame: TerrainFrame, row: TerrainRow) -> str:
    written = replace(frame, incline=float(np.radians(row.incline_deg)))
    touched = ContainerFit(frame, residual=0.0, roll=0.0)
    return fault_of(lambda: check_terrain(touched, written, is_forced=False))


def _body(stored: SensorCalibration, height: float) -> Mapping[str, object]:
    com = tuple(stored.com_in_frame_7(height).tolist())
    return {"mass": stored.fit.mass, "com": com}


def _checked(model: type[_M], values: object) -> _M:
    try:
        return model.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        location = ".".join(map(str, first["loc"]))
        raise SettingsError(
            f"A calibration makes {location} = {first['input']!r}: {first['msg']}.",
            hint="Calibrate again, or remove the line. Nothing was started.",
        ) from error


def _mismatch(name: str, theirs: str, ours: str) -> SettingsError:
    return SettingsError(
        f"{name} was measured with {theirs}, and is named for {ours}.",
        hint=f"Calibrate again, or {_INSTEAD.format(name=name)}. Nothing was started.",
    )
