"""Catalogue of faulty rigs: wiring, configuration and mounting errors.

One row per kind of fault, with a possible cause. Faults are applied to the simulated
hardware (arm, cables, sensor, pucks, bus, container); only a mistyped foot mass is
applied to the settings. A table in the tests lists the commissioning step that detects
each.
"""

from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache

import numpy as np

from acquisition.errors import SettingsError
from fakes.world.deviation import (
    BusDefects,
    ContainerError,
    ModuleDefects,
    RigDeviation,
    rotated_axes,
)
from wam.bus.frames import MOTOR_NODES
from wam.model.constants import Array

_CYCLE_NS = 2_000_000  # constant delay of replies
_FOREIGN_NODE = 20  # node of another program
_KGF = 0.10197  # per N
_GEAR_RATIO_ERROR = 9.48 / 9.7  # gear ratio of another generation's wrist


@dataclass(frozen=True, slots=True)
class WrongRig:
    """A rig whose hardware differs from its settings.

    Attributes:
        name: name for `--wrong`.
        fault: description of the fault.
        cause: possible cause.
        deviation: deviation of the hardware from settings and drawings.
    """

    name: str
    fault: str
    cause: str
    deviation: RigDeviation


def _scaled(**motors: float) -> Array:
    """Return the identity with the rows of motors scaled, e.g. `m2=0.5`, (7, 7)."""
    matrix = np.eye(7)
    for name, share in motors.items():
        matrix[int(name[1:]) - 1] *= share
    return matrix


def _swapped(a: int, b: int) -> Array:
    """Return the matrix of two swapped cables, 1-7, shape (7, 7)."""
    matrix = np.eye(7)
    matrix[[a - 1, b - 1]] = matrix[[b - 1, a - 1]]
    return matrix


def _foreign_matrix() -> Array:
    """Return a calibration of one sensor times the inverse of another one's, (6, 6)."""
    units = np.array([1.0, 1.0, 1.0, 0.05, 0.05, 0.05])  # comparable loads: N, N m
    mixed = 0.12 * np.random.default_rng(51).standard_normal((6, 6))
    return np.eye(6) + mixed * units[:, None] / units


def _with_properties(*properties: tuple[int, str, int]) -> RigDeviation:
    return RigDeviation(properties=properties)


def _with_sensor(shown: Array) -> RigDeviation:
    return RigDeviation(shown=shown)


# fmt: off
_RIGS = (
    WrongRig("pidx-3-is-2", "puck 3 reads the torque meant for puck 2 (PIDX 2)", "spare puck fitted", _with_properties((3, "PIDX", 2))),
    WrongRig("cts-tenfold", "all pucks state ten times their counts per turn", "setting from an older arm", _with_properties(*((node, "CTS", 40960) for node in MOTOR_NODES))),
    WrongRig("mixed-firmware", "puck 3 has firmware 60, which uses other property numbers", "repair", RigDeviation(versions=((3, 60),))),
    WrongRig("one-puck-replaced", "puck 3 has another serial number", "repair", _with_properties((3, "SN", 2003))),
    WrongRig("puck-4-silent", "puck 4 sends nothing", "broken transmit wire", RigDeviation(bus=BusDefects(silent=(4,)))),
    WrongRig("puck-6-hot", "puck 6 is at 58 degrees Celsius while idle", "stalled motor", _with_properties((6, "TEMP", 58), (6, "THERM", 57))),
    WrongRig("motor-3-reversed", "motor 3 turns in the wrong direction", "connector reversed", RigDeviation(torque=_scaled(m3=-1.0))),
    WrongRig("motors-5-6-swapped", "cables of motors 5 and 6 are swapped", "wiring loom", RigDeviation(torque=_swapped(5, 6))),
    WrongRig("motor-2-dead", "motor 2 produces no torque although its puck answers", "open phase", RigDeviation(torque=_scaled(m2=0.0))),
    WrongRig("motor-2-weak", "motor 2 produces 70 % of the commanded torque", "high contact resistance in one phase", RigDeviation(torque=_scaled(m2=0.7))),
    WrongRig("motor-7-half", "motor 7 produces half of the commanded torque", "high contact resistance in one phase", RigDeviation(torque=_scaled(m7=0.5))),
    WrongRig("encoder-4-reversed", "the encoder of motor 4 counts in the wrong direction", "wiring", RigDeviation(counts=_scaled(m4=-1.0))),
    WrongRig("encoders-6-7-swapped", "encoders of motors 6 and 7 are swapped", "wiring loom", RigDeviation(counts=_swapped(6, 7))),
    WrongRig("cable-4-torn", "the drive cable of motor 4 is off its drum", "broken cable", RigDeviation(torn=4)),
    WrongRig("friction-threefold", "joint friction is three times the nominal value", "seized pulley", RigDeviation(friction=3.0)),
    WrongRig("load-on-elbow", "a camera of 1 kg is strapped to link 3", "another experiment", RigDeviation(links=np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))),
    WrongRig("zero-2-off-10deg", "the zero of joint 2 is 10 degrees off", "homed against a bolt instead of the stop", RigDeviation(zeros=np.radians([0.0, -10.0, 0.0, 0.0, 0.0, 0.0, 0.0]))),
    WrongRig("wrist-9.48", "gear ratios of joints 5 and 6 are 9.48, not 9.7", "wrist of another generation", RigDeviation(ratios=np.array([1.0] * 4 + [_GEAR_RATIO_ERROR] * 2 + [1.0]))),
    WrongRig("base-on-ceiling", "the base is mounted on the ceiling", "mounting", RigDeviation(mount=np.radians([180.0, 0.0, 0.0]))),
    WrongRig("base-turned-90deg", "the base is turned by 90 degrees about the vertical", "mounting", RigDeviation(mount=np.radians([0.0, 0.0, 90.0]))),
    WrongRig("foot-forgotten", "rig.toml states a foot of 50 g, as if none were mounted", "typing error", RigDeviation(typed_foot_mass=0.05)),
    WrongRig("foot-heavier", "the foot is 1.5 times as heavy as rig.toml states", "another foot", RigDeviation(foot_mass=1.5)),
    WrongRig("centre-off-50mm", "the foot's centre of mass is 50 mm off axis", "wrong drawing", RigDeviation(foot_centre=np.array([0.0, 0.05, 0.0]))),
    WrongRig("sole-20mm-lower", "the sole is 20 mm lower", "another sole", RigDeviation(sole=np.array([0.0, 0.0, 0.02]))),
    WrongRig("sensor-turned-20deg", "the sensor is turned by 20 degrees about joint 7", "mounted in the wrong slot", _with_sensor(rotated_axes(np.radians([0.0, 0.0, 20.0]).tolist()))),
    WrongRig("sensor-sign", "the sensor reports the reaction", "sign convention", _with_sensor(-np.eye(6))),
    WrongRig("sensor-kgf", "forces are in kgf", "the vendor's tool", _with_sensor(np.diag([_KGF] * 3 + [1.0] * 3))),
    WrongRig("sensor-scale-95", "the sensor reads 5 % low", "calibration sheet of another sensor", _with_sensor(0.95 * np.eye(6))),
    WrongRig("sensor-foreign-matrix", "the calibration matrix belongs to another sensor", "files mixed up", _with_sensor(_foreign_matrix())),
    WrongRig("sensor-cable-pulls", "the sensor's cable pulls on the foot with 1 N", "strain relief", RigDeviation(cable=np.array([0.6, 0.8, 0.0]))),
    WrongRig("sensor-20ms-late", "forces arrive 20 ms late", "buffering", RigDeviation(force_late=0.020)),
    WrongRig("replies-a-cycle-late", "every position arrives one cycle late", "adapter", RigDeviation(bus=BusDefects(late_ns=tuple((node, _CYCLE_NS) for node in MOTOR_NODES)))),
    WrongRig("frames-lost", "0.1 % of the positions are lost", "sample point", RigDeviation(bus=BusDefects(lost=0.001))),
    WrongRig("duplicate-node", "two pucks have node number 5 and both answer", "spare puck", RigDeviation(bus=BusDefects(doubled=5))),
    WrongRig("other-master", "another program drives the arm", "second program", RigDeviation(bus=BusDefects(other_master=_FOREIGN_NODE))),
    WrongRig("stop-button-dead", "the stop button does nothing", "broken wire in the loom", RigDeviation(module=ModuleDefects(dead_button="estop"))),
    WrongRig("module-disobeys", "the safety module ignores the idle command of a host", "firmware", RigDeviation(module=ModuleDefects(is_disobedient=True))),
    WrongRig("vl2-doubled", "the safety module applies twice the commanded speed limit", "firmware", RigDeviation(module=ModuleDefects(limits=(("VL2", 2.0),)))),
    WrongRig("heartbeat-1s", "the safety module brakes only a second after the last positions", "firmware", RigDeviation(module=ModuleDefects(heartbeat=10.0))),
    WrongRig("incline-off-5deg", "the container is 5 degrees steeper than stated in matrix.toml", "typing error", RigDeviation(place=ContainerError(incline=float(np.radians(5.0))))),
    WrongRig("far-end-off-100mm", "the far end is 100 mm lower than stated in matrix.toml", "typing error", RigDeviation(place=ContainerError(far_end=(0.0, 0.0, -0.1)))),
    WrongRig("travel-too-long", "the container is 100 mm shorter than stated in matrix.toml", "typing error", RigDeviation(place=ContainerError(travel=-0.1))),
)
# fmt: on


@lru_cache(maxsize=1)
def catalogue() -> dict[str, WrongRig]:
    """Return the wrong rigs by name."""
    return {rig.name: rig for rig in _RIGS}


def wrong_rig(name: str) -> WrongRig:
    """Return the wrong rig of that name.

    Raises:
        SettingsError: there is no such rig.
    """
    rigs = catalogue()
    if name in rigs:
        return rigs[name]
    matches = get_close_matches(name.lower(), rigs, n=1, cutoff=0.6)
    suggestion = f"Did you mean {matches[0]}? " if matches else ""
    raise SettingsError(
        f"There is no wrong rig {name[:60]!r}.",
        hint=f"{suggestion}--wrong help lists them. Nothing was started.",
    )
