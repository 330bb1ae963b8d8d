"""Load a trial file; derive motion and forces from joint positions and raw wrench.

The analysis starts again from joint positions and raw wrench with the calibration that
the file carries, so a better calibration can be applied years later.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError, TrialFileError
from acquisition.sample import Flag, Record
from acquisition.settings import parse_toml
from acquisition.trial_file.reader import TrialReader
from analysis.data.inertia import InertialForce, inertial_force
from analysis.data.prepare import foot_velocity
from analysis.data.recorded_factors import StatedFactors, stated_factors
from analysis.data.series import TractionSeries
from analysis.data.tare_bracket import TareBracket, read_bracket
from ft_sensor.calibration.files import payload_from_toml, terrain_from_toml
from ft_sensor.payload import Payload, TerrainFrame, traction
from wam.model.arm_model import ArmModel
from wam.model.constants import ArmConstants, Body, load_constants
from wam.model.tool import Tool

Array = NDArray[np.float64]
Frame = Literal["terrain", "sole"]
_CALIBRATION, _TERRAIN = "ft_calibration.toml", "terrain.toml"
_ARM_MODEL = "arm_model.toml"
ATTACHMENTS = (_CALIBRATION, _TERRAIN, _ARM_MODEL)  # all three are required
_LONGEST_AGE = 0.1  # s; time stamps further apart are ignored
_LARGEST_ANGLE = 10.0  # rad, beyond every joint stop
_LONGEST_NUMBER = 20  # digits of a 64-bit integer


@dataclass(frozen=True, slots=True)
class RecordedTrial:
    """One recorded trial, checked and in arrays.

    Attributes:
        path: the file.
        metadata: metadata by name, e.g. `metadata["trial"]["operator"]`.
        terrain: name of the terrain.
        cycles: records of traction_msgs/Cycle, shape (n,).
        t: time since the first cycle [s], shape (n,).
        sole: centre of the sole in the base frame [m], shape (n, 3).
        rotation: foot to base, z out of the arm, shape (n, 3, 3).
        velocity: velocity of the sole in the base frame [m/s], shape (n, 3); NaN next
            to gaps.
        force: force of the ground on the foot in the base frame [N], shape (n, 3).
        traction: v_t [m/s], F_t [N], F_n [N] in the terrain frame, shape (n, 3).
        lateral: force along y_T [N], shape (n,).
        frame: pose of the container.
        payload: applied calibration and tare.
        constants: applied arm model.
        sole_point: centre of the sole in the frame of the tool plate [m], shape (3,).
        bracket: the tares before and after the trial; None if one is not known.
        sensor_height: height of the sensor's origin above the tool plate [m]; None
            if the recorded settings do not give it.
        friction_text: calibration of the arm's friction; empty if there was none.
    """

    path: Path
    metadata: dict[str, dict[str, str]]
    terrain: str
    cycles: Record
    t: Array
    sole: Array
    rotation: Array
    velocity: Array
    force: Array
    traction: Array
    lateral: Array
    frame: TerrainFrame
    payload: Payload
    constants: ArmConstants
    sole_point: Array
    bracket: TareBracket | None = None
    sensor_height: float | None = None
    friction_text: str = ""

    @property
    def name(self) -> str:
        """Session and trial, e.g. S012/T04."""
        trial = self.metadata["trial"]
        return f"{trial.get('session', '?')}/{trial.get('trial', '?')}"

    @property
    def stones(self) -> str:
        """Size of the stones: "small", "big", "none"; empty if not recorded."""
        return self.metadata["trial"].get("stone_size", "")

    @property
    def factors(self) -> StatedFactors:
        """Recorded factors of the terrain and the foot."""
        return stated_factors(self.metadata["trial"])

    @property
    def is_simulated(self) -> bool:
        """Whether the trial came from simulated devices."""
        return self.metadata["trial"].get("simulated") == "true"

    @property
    def displacement(self) -> Array:
        """Distance of the sole from the far end along x_T [m], shape (n,)."""
        return self.frame.displacement(self.sole)

    def series(self, frame: Frame = "terrain") -> TractionSeries:
        """Return the trial as velocity and forces over time.

        Args:
            frame: "terrain" projects onto the plane of the container, "sole" onto the
                sole with its tilt in each cycle; there the normal is opposite to joint
                7's axis and slip is along the projection of x_T onto the sole.
        """
        v_t, F_t, F_n = (self.traction if frame == "terrain" else self._on_sole()).T
        return TractionSeries(
            terrain=self.terrain,
            name=self.name,
            t=self.t,
            v_t=v_t,
            F_n=F_n,
            F_t=F_t,
            stones=self.stones,
            incline_deg=float(np.degrees(self.frame.incline)),
            factors=self.factors.values,
            units=self.factors.units,
            stamped_lag=self.stamped_lag,
            is_simulated=self.is_simulated,
        )

    @property
    def stamped_lag(self) -> float:
        """Age of the forces relative to the joints by their time stamps [s]."""
        ages = self.cycles["arm_ns"].astype(float) - self.cycles["ft_ns"].astype(float)
        fresh = (self.cycles["flags"] & Flag.FT_FRESH) != 0
        age = float(np.median(ages[fresh])) * 1e-9 if fresh.any() else 0.0
        return age if abs(age) < _LONGEST_AGE else 0.0

    def with_interpolated_tare(self) -> "RecordedTrial":
        """Return the trial with the sensor's zero interpolated between its two tares.

        Without both tares the trial is returned unchanged.
        """
        if self.bracket is None:
            return self
        drift = self.payload.sign * self.bracket.drift(self.t)
        return self._with_force(self.force - self.payload.to_base(drift, self.rotation))

    def inertial_force(self) -> InertialForce:
        """Inertial force of the foot in the base frame; raises SettingsError.

        The centre of mass is that of the payload: everything below the gauges.
        """
        origin = np.array([0.0, 0.0, self.sensor_height or 0.0])  # of the sensor
        from_sole = origin + self.payload.rotation @ self.payload.com - self.sole_point
        com = self.sole + self.rotation @ from_sole
        try:
            return inertial_force(self.t, com, self.payload.mass)
        except SettingsError as error:
            text = f"{self.name}: {error.message}"
            raise SettingsError(text, hint=error.hint) from error

    def without_inertia(self) -> "RecordedTrial":
        """Return the trial with the inertial force removed; raises SettingsError."""
        return self._with_force(self.force + self.inertial_force().force)

    def _with_force(self, force: Array) -> "RecordedTrial":
        axes = self.frame.axes()
        return replace(
            self,
            force=force,
            traction=traction(axes, self.velocity, force),
            lateral=force @ axes[1],
        )

    def _on_sole(self) -> Array:
        """Return v_t, F_t, F_n along the axes of the sole, shape (n, 3)."""
        normal = -self.rotation[:, :, 2]
        x_T = self.frame.axes()[0]
        along = x_T - (normal @ x_T)[:, None] * normal
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        v_t = np.einsum("ni,ni->n", self.velocity, along)
        F_t = -np.einsum("ni,ni->n", self.force, along)
        return np.column_stack([v_t, F_t, np.einsum("ni,ni->n", self.force, normal)])


def load_trial(path: Path | str) -> RecordedTrial:
    """Read a trial file, recovered or not, and derive sole, force and traction.

    Raises:
        TrialFileError: the file is not a sound trial, or lacks its calibration.
    """
    path = Path(path)
    reader = TrialReader(path)
    _check_metadata(reader)
    cycles = reader.cycles().data
    _check_cycles(path, cycles)
    setup = _read_setup(reader)
    payload, frame, axes = setup.payload, setup.frame, setup.frame.axes()
    metadata, attachments = reader.metadata, reader.attachments
    del reader  # frees the whole file before as much memory is allocated again
    start_ns = int(cycles["host_ns"][0])
    t = (cycles["host_ns"] - np.uint64(start_ns)).astype(float) * 1e-9
    path_of_sole = setup.model.sole_path(np.ascontiguousarray(cycles["position"]))
    velocity = foot_velocity(t, path_of_sole.position)
    raw = np.ascontiguousarray(cycles["wrench_raw"])
    contact = payload.contact(raw, path_of_sole.rotation)
    force = payload.to_base(contact, path_of_sole.rotation)
    trial = RecordedTrial(
        path=path,
        metadata=metadata,
        terrain=setup.terrain,
        cycles=cycles,
        t=t,
        sole=path_of_sole.position,
        rotation=path_of_sole.rotation,
        velocity=velocity,
        force=force,
        traction=traction(axes, velocity, force),
        lateral=force @ axes[1],
        frame=frame,
        payload=payload,
        constants=setup.model.constants,
        sole_point=setup.sole_point,
        bracket=read_bracket(path, metadata["trial"], payload.bias, start_ns),
        sensor_height=sensor_height_of(attachments.get("config.toml", b"")),
        friction_text=attachments.get("friction.toml", b"").decode(errors="ignore"),
    )
    try:
        trial.series()
    except SettingsError as error:
        raise TrialFileError(path, f"is unusable ({error.message})") from error
    return trial


class _Setup(NamedTuple):
    """Calibration, terrain and arm model attached to a trial file."""

    payload: Payload
    sole_point: Array
    terrain: str
    frame: TerrainFrame
    model: ArmModel


def _read_setup(reader: TrialReader) -> _Setup:
    """Return calibration, terrain and arm of a trial file.

    Raises:
        TrialFileError: one of them is missing or impossible.
    """
    try:
        payload, sole_point = payload_from_toml(_text(reader, _CALIBRATION))
        terrain, frame = terrain_from_toml(_text(reader, _TERRAIN))
        model = _arm(_text(reader, _ARM_MODEL), tuple(sole_point.tolist()))
    except SettingsError as error:
        raise TrialFileError(reader.path, error.message.rstrip(".")) from error
    except (ValueError, ArithmeticError, RuntimeError) as error:
        text = f"has an impossible arm model ({error})"
        raise TrialFileError(reader.path, text) from error
    return _Setup(payload, sole_point, terrain, frame, model)


@lru_cache(maxsize=16)  # the trials of a study share one or a few arm models
def _arm(constants: str, sole: tuple[float, ...]) -> ArmModel:
    """Return the arm model of `arm_model.toml` with a sole point on the tool plate."""
    none = Body(0.0, np.zeros(3), np.zeros((3, 3)))
    return ArmModel(load_constants(constants), Tool(none, none, np.array(sole)))


@lru_cache(maxsize=16)
def sensor_height_of(config: bytes) -> float | None:
    """Return the sensor height in recorded settings [m]; None if missing or invalid."""
    try:
        height = parse_toml(config.decode())["ft_sensor"]["height"]
    except (ValueError, KeyError, TypeError):
        return None
    return float(height) if type(height) in {int, float} and 0 <= height < 1 else None


def _check_metadata(reader: TrialReader) -> None:
    """Refuse a file without the metadata that the report shows for every trial."""
    for section, key in (("clock", "utc_offset_ns"), ("result", "cycles_missed")):
        value = reader.metadata.get(section, {}).get(key, "")
        if not value.removeprefix("-").isdecimal() or len(value) > _LONGEST_NUMBER:
            raise TrialFileError(
                reader.path,
                f"has no number {section}.{key} in its metadata",
                hint="Was the recording ended properly?",
            )
    if "provenance" not in reader.metadata:
        raise TrialFileError(reader.path, "lacks the metadata section provenance")


def _check_cycles(path: Path, cycles: Record) -> None:
    """Refuse records that no arm can have produced."""
    if len(cycles) < 3:
        raise TrialFileError(path, f"holds only {len(cycles)} cycles")
    if not bool((cycles["host_ns"][1:] > cycles["host_ns"][:-1]).all()):
        raise TrialFileError(path, "has cycles out of order")
    if not bool((np.abs(cycles["position"]) < _LARGEST_ANGLE).all()):
        raise TrialFileError(path, "has joint positions that no arm can reach")


def _text(reader: TrialReader, name: str) -> str:
    content = reader.attachments.get(name)
    if content is None:
        raise TrialFileError(reader.path, f"lacks the attachment {name}")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        raise TrialFileError(reader.path, f"{name} is not text") from error
