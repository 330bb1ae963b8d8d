"""Schema of rig.toml."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from acquisition.clock import RATE_HZ
from acquisition.control_loop.limits import GuardLimits
from acquisition.settings import (
    File,
    Number,
    SettingsSection,
    UsualRange,
    Whole,
)
from experiments.settings.matrix import FootName, PlaceName
from experiments.settings.places import StatedPlace
from ft_sensor.reading import largest_load
from ft_sensor.vendors.registry import AnySensor
from wam.calibration.arm_identity import SerialNumbers

WITHIN_RANGE = 0.9  # share of the sensor's range for default contact limits
CONTACT_LIMITS = (
    "contact_force",
    "contact_force_hold",
    "contact_moment",
    "contact_moment_hold",
    "contact_growth",
)
LOCK_DAMPING = 0.0075  # s, least ratio of lock_kd to lock_kp
_Turn = Annotated[Whole, Field(ge=0, lt=65536)]  # counts of one motor turn
_Angle = Annotated[Number, Field(ge=-6.3, le=6.3), UsualRange(-4.0, 4.0, "rad")]
_Aside = Annotated[Number, Field(ge=-0.1, le=0.1), UsualRange(-0.05, 0.05, "m")]
_Below = Annotated[Number, Field(ge=0.02, le=0.25), UsualRange(0.03, 0.2, "m")]
_OnPlate = tuple[_Aside, _Aside, _Below]  # in frame 7
_Inertia = Annotated[Number, Field(ge=1e-6, le=0.05), UsualRange(1e-5, 2e-3, "kg m^2")]
# Speeds up to twice the shipped limits, torques up to the shipped ones: the motors can
# give more, but no trial needs it; with less torque than its weight the arm sinks.
_ShoulderSpeed = Annotated[Number, Field(gt=0, le=3.0), UsualRange(0.3, 2.2, "rad/s")]
_UpperArmSpeed = Annotated[Number, Field(gt=0, le=4.0), UsualRange(0.4, 3.0, "rad/s")]
_ElbowSpeed = Annotated[Number, Field(gt=0, le=5.0), UsualRange(0.5, 3.7, "rad/s")]
_WristSpeed = Annotated[Number, Field(gt=0, le=8.0), UsualRange(0.8, 6.0, "rad/s")]
_Speeds = tuple[
    _ShoulderSpeed,
    _ShoulderSpeed,
    _UpperArmSpeed,
    _ElbowSpeed,
    _WristSpeed,
    _WristSpeed,
    _WristSpeed,
]
_ElbowTorque = Annotated[Number, Field(gt=0, le=15.0), UsualRange(7.5, 15.0, "N m")]
_WristTorque = Annotated[Number, Field(gt=0, le=2.5), UsualRange(1.2, 2.5, "N m")]
_Torques = tuple[
    Annotated[Number, Field(gt=0, le=20.0), UsualRange(10.0, 20.0, "N m")],
    Annotated[Number, Field(gt=0, le=45.0), UsualRange(25.0, 45.0, "N m")],
    _ElbowTorque,
    _ElbowTorque,
    _WristTorque,
    _WristTorque,
    Annotated[Number, Field(gt=0, le=1.3), UsualRange(0.6, 1.3, "N m")],
]


class CanSettings(SettingsSection):
    """The CAN interface, in python-can's words."""

    interface: str = Field(examples=["socketcan"])
    channel: str = Field(examples=["can0"])
    bitrate: Annotated[Whole, UsualRange(1_000_000, 1_000_000, "bit/s")] = Field(
        ge=10_000, le=1_000_000, examples=[1000000]
    )


class ArmSection(SettingsSection):
    """Data of this arm.

    Attributes:
        mech_at_home: absolute angles of the motors at the home position [counts], as
            printed by "traction zero"; omitted: the next zeroing is not checked.
        rest: joint positions with the foot on its stand [rad]; omitted: a person
            supports the arm before it goes idle.
        serial_numbers: serial numbers of the seven pucks; omitted: any arm.
        properties: file with the properties of this arm's pucks if they differ from the
            factory's; a path relative to the folder of rig.toml.
    """

    mech_at_home: tuple[_Turn, _Turn, _Turn, _Turn, _Turn, _Turn, _Turn] | None = Field(
        default=None, examples=[[1012, 340, 2761, 95, 4001, 1200, 2048]]
    )
    rest: tuple[_Angle, _Angle, _Angle, _Angle, _Angle, _Angle, _Angle] | None = Field(
        default=None, examples=[[0.0, 0.77, 0.0, 1.19, 0.0, 1.19, 0.0]]
    )
    serial_numbers: SerialNumbers | None = Field(
        default=None, examples=[[1201, 1202, 1203, 1204, 1205, 1206, 1207]]
    )
    properties: File | None = Field(default=None, examples=["pucks.toml"])


class SimulatedSole(SettingsSection):
    """Friction of a sole on a plate, for the simulation; equation: `fakes.ground`.

    Attributes:
        mu_s: coefficient of static friction.
        mu_k: coefficient of kinetic friction.
        v_S: Stribeck velocity [m/s].
        b: viscous friction [N s/m].
    """

    mu_s: Annotated[Number, Field(gt=0, le=2)]
    mu_k: Annotated[Number, Field(gt=0, le=2)]
    v_S: Annotated[Number, Field(gt=0, le=1)]
    b: Annotated[Number, Field(ge=0, le=100)]

    @model_validator(mode="after")
    def _holds_at_rest(self) -> Self:
        if self.mu_k > self.mu_s:
            raise ValueError("mu_k is above mu_s, which no sole has")
        return self


class FootSection(SettingsSection):
    """A foot with its adapter, in frame 7.

    Attributes:
        shape: shape of the sole; recorded with its trials.
        area: area of the sole [m^2]; recorded with its trials.
        simulate: its friction on a plate in a simulation; omitted: that of the foot
            with tread.
    """

    mass: Annotated[Number, UsualRange(0.1, 1.5, "kg")] = Field(
        ge=0.05, le=2.0, examples=[0.45]
    )
    com: _OnPlate = Field(examples=[[0.01, 0.0, 0.062]])
    inertia: tuple[_Inertia, _Inertia, _Inertia] = Field(
        examples=[[4e-4, 5.5e-4, 4.5e-4]]
    )
    sole: _OnPlate = Field(examples=[[0.01, 0.0, 0.112]])
    calibration: File | None = Field(default=None, examples=["foot_tread.toml"])
    shape: Literal["flat", "round", "point"] | None = None
    area: (
        Annotated[Number, Field(gt=0, le=0.1), UsualRange(1e-4, 0.02, "m^2")] | None
    ) = None
    simulate: SimulatedSole | None = None

    def plain(self) -> dict[str, Any]:
        """Return plain values, without unset fields of the sole."""
        values = self.model_dump(mode="json")
        optional = ("shape", "area", "simulate")
        return {k: v for k, v in values.items() if k not in optional or v is not None}


class ControlSection(SettingsSection):
    """Parameters of the control law.

    Within these bounds the lock is stable in every pose, with the shipped foot and a
    delay of a whole cycle from positions to torques.
    """

    virtual_mass: Annotated[Number, UsualRange(0.0, 1.0, "kg")] = Field(
        ge=0, le=2, examples=[0.30]
    )
    lock_kp: Annotated[Number, UsualRange(10.0, 22.0, "N m/rad")] = Field(
        ge=0, le=22, examples=[20.0]
    )
    lock_kd: Annotated[Number, UsualRange(0.1, 0.23, "N m s/rad")] = Field(
        ge=0, le=0.25, examples=[0.2]
    )

    @model_validator(mode="after")
    def _is_damped(self) -> Self:
        least = LOCK_DAMPING * self.lock_kp
        if self.lock_kd < least:
            raise ValueError(
                f"lock_kd = {self.lock_kd:g} N m s/rad lets the lock of joint 7 "
                f"oscillate - expected >= {least:.3g} at lock_kp = {self.lock_kp:g}"
            )
        return self


class GravitySection(SettingsSection):
    """Gravity model of the control law.

    "cad": masses of the drawings; "shipped": first moments of another arm;
    "calibrated": those of `file`, a path relative to the folder of rig.toml.
    """

    model: Literal["cad", "shipped", "calibrated"] = Field(examples=["cad"])
    file: File = Field(default="gravity.toml", examples=["gravity.toml"])


class FrictionSettings(SettingsSection):
    """Compensation of the drives' dry friction while the arm floats.

    Attributes:
        model: "none"; "calibrated": that of `file`, a path relative to the folder of
            rig.toml.
        file: the calibration.
        compensation: share of the lower confidence bound of the calibrated friction.
    """

    model: Literal["none", "calibrated"] = Field(default="none", examples=["none"])
    file: File = Field(default="friction.toml", examples=["friction.toml"])
    compensation: Annotated[Number, UsualRange(0.0, 0.75)] = Field(
        default=0.7, ge=0, le=0.8, examples=[0.7]
    )

    @property
    def share(self) -> float:
        """Compensated share, 0 without a calibration."""
        return self.compensation if self.model == "calibrated" else 0.0


class LimitSection(SettingsSection):
    """Limits of the guard, with the names and units of `GuardLimits`; and others.

    `tare_spread`, `residual` and `free_disk_gb` are checked between trials. A push
    needs up to 60 N along the ground and 30 N across it. A trial ends at 100 N and the
    arm holds at 150 N, and at the corresponding moments with 0.1 m between sole and
    sensor. For a sensor of smaller range, omitted limits and these values become 0.9 of
    the range, see `RigSettings.lowered_limits`.
    """

    speed: _Speeds = Field(examples=[[1.5, 1.5, 2.0, 2.5, 4.0, 4.0, 4.0]])
    torque: _Torques = Field(examples=[[20, 45, 15, 15, 2.5, 2.5, 1.3]])
    foot_speed: Annotated[Number, UsualRange(0.3, 0.9, "m/s")] = Field(
        ge=0.05, le=1.0, examples=[0.8]
    )
    joint7_mrad: Annotated[Number, UsualRange(10.0, 80.0, "mrad")] = Field(
        ge=2, le=100, examples=[50.0]
    )
    ft_stale_ms: Annotated[Number, UsualRange(3.0, 12.0, "ms")] = Field(
        ge=2, le=20, examples=[6.0]
    )
    ft_stop_ms: Annotated[Number, UsualRange(10.0, 40.0, "ms")] = Field(
        ge=5, le=50, examples=[20.0]
    )
    ft_saturated_ms: Annotated[Number, UsualRange(10.0, 200.0, "ms")] = Field(
        default=100.0, ge=2, le=500, examples=[100.0]
    )
    contact_force: Annotated[Number, UsualRange(30.0, 120.0, "N")] = Field(
        default=100.0, ge=5, le=200, examples=[100.0]
    )
    contact_force_hold: Annotated[Number, UsualRange(40.0, 180.0, "N")] = Field(
        default=150.0, ge=5, le=250, examples=[150.0]
    )
    contact_moment: Annotated[Number, UsualRange(1.0, 12.0, "N m")] = Field(
        default=10.0, ge=0.5, le=20, examples=[10.0]
    )
    contact_moment_hold: Annotated[Number, UsualRange(1.5, 18.0, "N m")] = Field(
        default=15.0, ge=0.5, le=25, examples=[15.0]
    )
    contact_growth: Annotated[Number, UsualRange(15.0, 80.0, "N")] = Field(
        default=40.0, ge=5, le=150, examples=[40.0]
    )
    late_per_second: Annotated[Whole, UsualRange(1, 20, "cycles/s", real=20)] = Field(
        ge=1, le=RATE_HZ, examples=[10]
    )
    tare_spread: Annotated[Number, UsualRange(0.1, 1.5, "N")] = Field(
        ge=0.05, le=3, examples=[0.5]
    )
    residual: Annotated[Number, UsualRange(0.3, 2.0, "N")] = Field(
        default=1.0, ge=0.1, le=5, examples=[1.0]
    )
    free_disk_gb: Annotated[Number, UsualRange(1.0, 30.0, "GB")] = Field(
        ge=0, le=100000, examples=[5.0]
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        pairs = (
            (self.contact_force, self.contact_force_hold),
            (self.contact_moment, self.contact_moment_hold),
        )
        if any(end > hold for end, hold in pairs):
            raise ValueError("a contact limit that ends a trial is above that of hold")
        return self

    def of_guard(self) -> dict[str, Any]:
        """Return the values of the fields of `GuardLimits`."""
        names = GuardLimits.__dataclass_fields__.keys() & type(self).model_fields.keys()
        return {name: getattr(self, name) for name in names}


_ModuleSpeed = Annotated[Number, Field(gt=0, le=1.5), UsualRange(0.1, 1.2, "m/s")]
_ModuleTorque = Annotated[
    Whole, Field(gt=0, le=8100), UsualRange(500, 7000, "puck units")
]


class SafetySection(SettingsSection):
    """Limits of the safety module; an omitted warning is 0.9 of its fault."""

    speed_warning: _ModuleSpeed | None = Field(default=None, examples=[0.5])
    speed_fault: _ModuleSpeed = Field(examples=[1.0])
    torque_warning_units: _ModuleTorque | None = Field(default=None, examples=[4731])
    torque_fault_units: _ModuleTorque = Field(examples=[5204])


# Defaults of the module after power-up.
_POWER_UP = SafetySection(
    speed_warning=0.5,
    speed_fault=1.0,
    torque_warning_units=4731,
    torque_fault_units=5204,
)


class LoopSection(SettingsSection):
    """Timing of the loop.

    Attributes:
        spin_us: busy-waiting before each deadline, for a kernel that wakes late, at the
            cost of that share of a core.
        test_time: duration of the preflight's test of the loop.
    """

    spin_us: Annotated[Number, UsualRange(0.0, 300.0, "us")] = Field(
        default=0.0, ge=0, le=500, examples=[0]
    )
    test_time: Annotated[Number, UsualRange(1.0, 30.0, "s")] = Field(
        default=5.0, ge=0.5, le=3600, examples=[5]
    )


class OperatorSection(SettingsSection):
    """Cues between program and operator.

    Attributes:
        bell: ring the terminal's bell at the start, when too fast, and at the end.
        speech: speak the same cues if a speech program is installed.
        double_tap: two presses of the foot start a trial, and keep it.
    """

    bell: bool = Field(default=True, strict=True, examples=[True])
    speech: bool = Field(default=False, strict=True, examples=[False])
    double_tap: bool = Field(default=False, strict=True, examples=[False])


class RigSettings(SettingsSection):
    """Everything in rig.toml."""

    can: CanSettings
    arm: ArmSection = ArmSection()
    ft_sensor: Annotated[AnySensor, Field(discriminator="kind")]
    feet: dict[FootName, FootSection] = Field(min_length=1, max_length=16)
    places: dict[PlaceName, StatedPlace] = Field(
        default_factory=dict[str, StatedPlace], max_length=100
    )
    control: ControlSection
    limits: LimitSection
    gravity: GravitySection = GravitySection(model="cad")
    friction: FrictionSettings = FrictionSettings()
    loop: LoopSection = LoopSection()
    operator: OperatorSection = OperatorSection()
    safety: SafetySection = _POWER_UP

    @model_validator(mode="after")
    def _is_measured(self) -> Self:
        for name, (most, unit) in self._measured().items():
            limit = getattr(self.limits, name)
            if limit > most and limit != LimitSection.model_fields[name].default:
                raise ValueError(
                    f"limits.{name} = {limit:g} {unit} is beyond the {most:g} {unit} "
                    f"that the {self.ft_sensor.kind} sensor measures"
                )
        return self

    def lowered_limits(self) -> dict[str, float]:
        """Return the contact limits lowered by the range of the sensor.

        A limit with its default value is at most `WITHIN_RANGE` of the range; a limit
        that ends a trial never exceeds that of hold.
        """
        lowered: dict[str, float] = {}
        for name, (reach, _) in self._measured().items():
            least = 0.0
            if name.endswith("_hold"):
                ends = name.removesuffix("_hold")
                own: float = getattr(self.limits, ends)
                least = lowered.get(ends, own)
            limit, most = getattr(self.limits, name), max(WITHIN_RANGE * reach, least)
            if limit == LimitSection.model_fields[name].default and limit > most:
                lowered[name] = most
        return lowered

    def guard_limits(self) -> dict[str, Any]:
        """Return the limits of the guard, lowered for this sensor."""
        return {**self.limits.of_guard(), **self.lowered_limits()}

    def _measured(self) -> dict[str, tuple[float, str]]:
        """Return the range of the sensor by contact limit, with the unit."""
        ranges = self.ft_sensor.known_ranges()
        if ranges is None:
            return {}
        force, moment = largest_load(ranges)
        return {
            name: (moment, "N m") if "moment" in name else (force, "N")
            for name in CONTACT_LIMITS
        }
