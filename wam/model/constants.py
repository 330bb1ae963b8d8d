"""Constants of the arm, read from TOML and validated."""

from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    Field,
    PositiveInt,
    model_validator,
)

from acquisition.errors import SettingsError
from acquisition.settings import SettingsSection, parse_toml
from acquisition.validation import Many, first_problem

GRAVITY = 9.81  # m/s^2
Array = NDArray[np.float64]

_Vector3 = tuple[float, float, float]
_Vector7 = tuple[float, float, float, float, float, float, float]
_Counts7 = tuple[
    PositiveInt,
    PositiveInt,
    PositiveInt,
    PositiveInt,
    PositiveInt,
    PositiveInt,
    PositiveInt,
]


class KinematicsSection(SettingsSection):
    """Denavit-Hartenberg: angles [pi rad], lengths and offsets [m]."""

    alpha_over_pi: _Vector7
    a: _Vector7
    d: _Vector7


class LimitsSection(SettingsSection):
    """Joint stops [rad]."""

    lower: _Vector7
    upper: _Vector7

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if any(low >= high for low, high in zip(self.lower, self.upper, strict=True)):
            raise ValueError("a lower stop is not below its upper stop")
        return self


class HomeSection(SettingsSection):
    """Joint positions [rad] at the home pose."""

    position: _Vector7


class TransmissionSection(SettingsSection):
    """Joint to motor positions, a matrix."""

    j2mp: tuple[_Vector7, _Vector7, _Vector7, _Vector7, _Vector7, _Vector7, _Vector7]


class PucksSection(SettingsSection):
    """Encoder counts per turn, torque units per N m, poles."""

    cts: _Counts7
    ipnm: _Counts7
    poles: _Counts7
    mt: _Counts7


class MotorsSection(SettingsSection):
    """Inertia of each drive [kg m^2]."""

    drive_inertia: _Vector7


class LinkSection(SettingsSection):
    """Mass [kg], centre [m] and inertia [kg m^2] of a link."""

    mass: float = Field(gt=0)
    com: _Vector3
    inertia: tuple[_Vector3, _Vector3, _Vector3]


class FrictionSection(SettingsSection):
    """Coulomb [N m] and viscous [N m s/rad] friction of the joints."""

    coulomb: _Vector7
    viscous: _Vector7


class ConstantsControlSection(SettingsSection):
    """Gains of a joint controller [N m/rad], [N m s/rad]."""

    kp: _Vector7
    kd: _Vector7


class GravityConstantsSection(SettingsSection):
    """First moments [kg m] and poses of the maker's gravity calibration."""

    mus: tuple[_Vector3, _Vector3, _Vector3, _Vector3, _Vector3, _Vector3, _Vector3]
    poses: Many[_Vector7]


class ConstantsFile(SettingsSection):
    """Layout of the file."""

    kinematics: KinematicsSection
    joint_limits: LimitsSection
    home: HomeSection
    transmission: TransmissionSection
    pucks: PucksSection
    motors: MotorsSection
    links: Many[LinkSection] = Field(min_length=7, max_length=7)
    gravity: GravityConstantsSection
    friction: FrictionSection
    control: ConstantsControlSection


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body: mass [kg], centre [m] shape (3,), inertia about it (3, 3)."""

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True, slots=True)
class ArmConstants:
    """Constants of the arm; SI units, seven joints or motors per array.

    Attributes:
        alpha: Denavit-Hartenberg twists [rad].
        a: Denavit-Hartenberg offsets along x [m].
        d: Denavit-Hartenberg offsets along z [m].
        q_lower: lower joint stops [rad].
        q_upper: upper joint stops [rad].
        home: joint positions of the home pose [rad].
        j2mp: motor angle = j2mp @ joint angle, shape (7, 7).
        cts: encoder counts per motor turn (factory).
        ipnm: torque units per N m at the motor (factory).
        poles: motor poles; those of puck 7 distinguish a wrist from gimbals.
        mt: torque limit of each puck [puck units].
        drive_inertia: drive inertia at the rotors [kg m^2].
        links: the seven links in their own distal frames.
        mus: first moments of another arm, frames 1..7 [kg m], shape (7, 3).
        calibration_poses: poses of a gravity calibration [rad], shape (n, 7).
        coulomb: Coulomb friction of another arm [N m].
        viscous: viscous friction of another arm [N m s/rad].
        kp: joint position gains [N m/rad].
        kd: joint damping gains [N m s/rad].
        text: TOML source, for the recording.
    """

    alpha: Array
    a: Array
    d: Array
    q_lower: Array
    q_upper: Array
    home: Array
    j2mp: Array
    cts: tuple[int, ...]
    ipnm: tuple[int, ...]
    poles: tuple[int, ...]
    mt: tuple[int, ...]
    drive_inertia: Array
    links: tuple[Body, ...]
    mus: Array
    calibration_poses: Array
    coulomb: Array
    viscous: Array
    kp: Array
    kd: Array
    text: str


@lru_cache(maxsize=8)  # the trials of a study usually carry the same text
def _parsed(text: str) -> ConstantsFile:
    return ConstantsFile.model_validate(parse_toml(text))


def load_constants(text: str | None = None) -> ArmConstants:
    """Return the constants in `text` (TOML), by default those shipped.

    Raises:
        SettingsError: `text` is not TOML, or not a valid file of constants.
    """
    if text is None:
        text = (resources.files("wam.data") / "wam7.toml").read_text()
    try:
        file = _parsed(text)
    except ValueError as error:
        raise SettingsError(
            f"The arm model cannot be read: {first_problem(error)}.",
            hint="Use the model shipped with Traction as a pattern.",
        ) from error
    links = tuple(
        Body(link.mass, np.array(link.com), np.array(link.inertia))
        for link in file.links
    )
    return ArmConstants(
        alpha=np.pi * np.array(file.kinematics.alpha_over_pi),
        a=np.array(file.kinematics.a),
        d=np.array(file.kinematics.d),
        q_lower=np.array(file.joint_limits.lower),
        q_upper=np.array(file.joint_limits.upper),
        home=np.array(file.home.position),
        j2mp=np.array(file.transmission.j2mp),
        cts=file.pucks.cts,
        ipnm=file.pucks.ipnm,
        poles=file.pucks.poles,
        mt=file.pucks.mt,
        drive_inertia=np.array(file.motors.drive_inertia),
        links=links,
        mus=np.array(file.gravity.mus),
        calibration_poses=np.array(file.gravity.poses),
        coulomb=np.array(file.friction.coulomb),
        viscous=np.array(file.friction.viscous),
        kp=np.array(file.control.kp),
        kd=np.array(file.control.kd),
        text=text,
    )
