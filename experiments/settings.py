"""rig.toml and matrix.toml: read, checked, with an error that says what to write."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError

from acquisition.errors import SettingsError
from experiments.sensor_settings import SensorSection, build_device
from experiments.settings_base import (
    File,
    Mass,
    Near,
    Number,
    Positive,
    Section,
    Vector3,
    Whole,
)
from experiments.settings_errors import explain

_Angles = tuple[Near, Near, Near, Near, Near, Near, Near]
_Turn = Annotated[Whole, Field(ge=0, lt=65536)]  # counts of one motor turn
_Task = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\x00-\x1f]+$")]
_M = TypeVar("_M", bound=BaseModel)
_LARGEST = 1_000_000  # bytes; a matrix has a few thousand
_Limits = tuple[Positive, Positive, Positive, Positive, Positive, Positive, Positive]


class CanSettings(Section):
    """The CAN interface, in python-can's words."""

    interface: str = Field(examples=["socketcan"])
    channel: str = Field(examples=["can0"])
    bitrate: Whole = Field(gt=0, examples=[1000000])


class ArmSection(Section):
    """This arm.

    Attributes:
        mech_at_home: absolute angles of the motors at the home position [counts], as
            "traction zero" tells them; left out: the next zeroing is not checked.
    """

    mech_at_home: tuple[_Turn, _Turn, _Turn, _Turn, _Turn, _Turn, _Turn] | None = Field(
        default=None, examples=[[1012, 340, 2761, 95, 4001, 1200, 2048]]
    )


class FootSection(Section):
    """A foot with its adapter, in frame 7."""

    mass: Mass = Field(examples=[0.45])
    com: Vector3 = Field(examples=[[0.01, 0.0, 0.062]])
    inertia: tuple[Positive, Positive, Positive] = Field(
        examples=[[4e-4, 5.5e-4, 4.5e-4]]
    )
    sole: Vector3 = Field(examples=[[0.01, 0.0, 0.112]])
    calibration: File | None = Field(default=None, examples=["foot_tread.toml"])


class Feet(Section):
    """The two feet of the experiment."""

    tread: FootSection
    bare: FootSection


class ControlSection(Section):
    """The control law's numbers."""

    virtual_mass: Number = Field(ge=0, le=2, examples=[0.30])
    lock_kp: Number = Field(ge=0, le=30, examples=[20.0])
    lock_kd: Number = Field(ge=0, le=0.25, examples=[0.2])


class GravitySection(Section):
    """Which model of gravity floats the arm.

    "cad": masses of the drawings; "shipped": first moments of another arm;
    "calibrated": those of `file`, a path from the folder of rig.toml.
    """

    model: Literal["cad", "shipped", "calibrated"] = Field(examples=["cad"])
    file: File = Field(default="gravity.toml", examples=["gravity.toml"])


class LimitSection(Section):
    """Where the guard steps in."""

    speed: _Limits = Field(examples=[[1.5, 1.5, 2.0, 2.5, 4.0, 4.0, 4.0]])
    torque: _Limits = Field(examples=[[20, 45, 15, 15, 2.5, 2.5, 1.3]])
    foot_speed: Positive = Field(examples=[0.8])
    joint7_mrad: Positive = Field(examples=[50.0])
    ft_stale_ms: Positive = Field(examples=[6.0])
    ft_stop_ms: Positive = Field(examples=[20.0])
    late_per_second: Whole = Field(ge=1, le=500, examples=[10])
    tare_spread: Positive = Field(examples=[0.5])
    residual: Positive = Field(default=1.0, examples=[1.0])
    free_disk_gb: Number = Field(ge=0, examples=[5.0])


class SafetySection(Section):
    """What the safety module tolerates; a warning left out is 0.9 of its fault."""

    speed_warning: Annotated[Number, Field(gt=0, le=2)] | None = Field(
        default=None, examples=[0.5]
    )
    speed_fault: Number = Field(gt=0, le=2, examples=[1.0])
    torque_warning_units: Annotated[Whole, Field(gt=0, le=8191)] | None = Field(
        default=None, examples=[4731]
    )
    torque_fault_units: Whole = Field(gt=0, le=8191, examples=[5204])


# What the module does by itself after power-up.
_POWER_UP = SafetySection(
    speed_warning=0.5,
    speed_fault=1.0,
    torque_warning_units=4731,
    torque_fault_units=5204,
)


class LoopSection(Section):
    """How the loop keeps time.

    Attributes:
        spin_us: it stops sleeping so long before each deadline and watches the time;
            for a kernel that wakes late. It costs the share of the core.
    """

    spin_us: Number = Field(default=0.0, ge=0, le=500, examples=[0])


class OperatorSection(Section):
    """How the program and the person at the arm tell each other something.

    Attributes:
        bell: the terminal rings at the start, when too fast, and at the end.
        speech: the same is spoken where a speech program is installed.
        double_tap: two presses of the foot start a trial, and keep it.
    """

    bell: bool = Field(default=True, strict=True, examples=[True])
    speech: bool = Field(default=False, strict=True, examples=[False])
    double_tap: bool = Field(default=False, strict=True, examples=[False])


class RigSettings(Section):
    """Everything in rig.toml."""

    can: CanSettings
    arm: ArmSection = ArmSection()
    ft_sensor: SensorSection
    feet: Feet
    control: ControlSection
    limits: LimitSection
    gravity: GravitySection = GravitySection(model="cad")
    loop: LoopSection = LoopSection()
    operator: OperatorSection = OperatorSection()
    safety: SafetySection = _POWER_UP


class TerrainRow(Section):
    """One row of the matrix.

    `reset`: what a person does to the terrain before every trial.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9-]{0,15}$", examples=["S10"])
    stones: Literal["small", "big", "none"] = Field(examples=["small"])
    incline_deg: Number = Field(ge=0, le=30, examples=[10.0])
    foot: Literal["tread", "bare"] = Field(examples=["tread"])
    far_end: Vector3 = Field(examples=[[0.70, 0.0, 0.12]])
    heading_deg: Number = Field(ge=-180, le=180, examples=[0.0])
    travel: Number = Field(gt=0.05, le=1.0, examples=[0.45])
    trials: Whole = Field(ge=1, le=99, examples=[10])
    reset: tuple[_Task, ...] = Field(
        default=("rake", "level", "foot at the far end"),
        min_length=1,
        max_length=9,
        examples=[["rake", "level", "foot at the far end"]],
    )
    start_q: _Angles = Field(examples=[[0, 0.77, 0, 1.19, 0, 1.19, 0]])
    calibration: File | None = Field(default=None, examples=["terrain_S10.toml"])


class MatrixSettings(Section):
    """Everything in matrix.toml."""

    terrains: tuple[TerrainRow, ...] = Field(min_length=1)


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


def _read(path: Path) -> str:
    try:
        # A pipe or a device would be read for ever.
        is_plain = path.is_file() or path.is_dir() or not path.exists()
        if not is_plain or path.stat().st_size > _LARGEST:
            raise ValueError
        return path.read_text()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is no text"
        raise SettingsError(
            f"{path} cannot be read ({reason}).",
            hint="Name a rig.toml with --config. Nothing was started.",
        ) from error


def _parse(model: type[_M], text: str, name: str) -> _M:
    try:
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise SettingsError(f"{name}: {error}.", hint="Nothing was started.") from error
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise SettingsError(
            explain(model, name, error), hint="Nothing was started."
        ) from error
