"""Calibrations of friction compared with the truth of simulated arms."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wam.calibration.joint_friction import joint_breakaway, speed_curve
from wam.model.constants import load_constants
from wam.model.friction import friction_of

COULOMB, ASYMMETRY, BREAKAWAY = 0.1, 0.2, 0.15
CURVE = np.array([0.1] * 4 + [0.2] * 3)
_CONSTANTS = load_constants()
_SPEEDS = np.geomspace(0.01, 0.4, 30)  # rad/s


@dataclass(frozen=True, slots=True)
class CalibrationErrors:
    """Errors of one calibration by joint, shapes (7,).

    Attributes:
        coulomb: relative error.
        asymmetry: error as a share of Coulomb friction.
        breakaway: signed relative error.
        curve: largest relative error of the torque over 0.01 to 0.4 rad/s.
    """

    coulomb: np.ndarray
    asymmetry: np.ndarray
    breakaway: np.ndarray
    curve: np.ndarray


@dataclass(frozen=True, slots=True)
class Verdict:
    """One bound, compared with the calibrations of a share.

    Attributes:
        name: bounded quantity.
        values: worst value of the seeds, or their median, by joint, shape (7,).
        bounds: upper bounds, shape (7,).
    """

    name: str
    values: np.ndarray
    bounds: np.ndarray

    @property
    def is_met(self) -> bool:
        return bool((self.values < self.bounds).all())


def errors_of(found: Path, true: Path) -> CalibrationErrors:
    """Errors of a calibration.

    Args:
        found: file of the calibration.
        true: file of the true friction of the simulated arm.
    """
    tables = [tomllib.loads(path.read_text()) for path in (found, true)]
    friction = [friction_of(table["motors"]) for table in tables]
    coulomb, truth = (np.array(table["coulomb"]) for table in tables)
    asymmetry = [np.array(table["asymmetry"]) for table in tables]
    broken = [joint_breakaway(_CONSTANTS, each) for each in friction]
    curves = [
        [speed_curve(_CONSTANTS, each, joint, _SPEEDS) for joint in range(7)]
        for each in friction
    ]
    return CalibrationErrors(
        coulomb=np.abs(coulomb / truth - 1.0),
        asymmetry=np.abs(asymmetry[0] - asymmetry[1]) / truth,
        breakaway=broken[0] / broken[1] - 1.0,
        curve=np.abs(np.divide(*curves) - 1.0).max(axis=1),
    )


def verdicts(errors: Sequence[CalibrationErrors]) -> list[Verdict]:
    """Verdicts on one share; for break-away the median over seeds counts."""
    broken = np.median([np.abs(each.breakaway) for each in errors], axis=0)
    worst = {
        name: np.max([getattr(each, name) for each in errors], axis=0)
        for name in ("coulomb", "asymmetry", "curve")
    }
    return [
        Verdict("Coulomb", worst["coulomb"], np.full(7, COULOMB)),
        Verdict("asymmetry", worst["asymmetry"], np.full(7, ASYMMETRY)),
        Verdict("curve", worst["curve"], CURVE),
        Verdict("break-away, median", broken, np.full(7, BREAKAWAY)),
    ]
