"""Calibrations of friction held against the truth of simulated arms.

python -m studies.friction_calibrations [--shares 0.2 0.4 1] [--seeds 1 2 3 4 5]
    [--keep FOLDER] [--write docs/friction.md]

Every seed draws another arm. About two minutes each on an idle core; what is in FOLDER
already is not calibrated again. Exits with 1 where a bound is exceeded.
"""

import argparse
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studies.friction_page import with_calibrations
from wam.calibration.joint_friction import joint_breakaway, speed_curve
from wam.model.constants import load_constants
from wam.model.friction import friction_of

SHARES, SEEDS = (0.2, 0.4, 1.0), (1, 2, 3, 4, 5)
COULOMB, ASYMMETRY, BREAKAWAY = 0.1, 0.2, 0.15
CURVE = np.array([0.1] * 4 + [0.2] * 3)
_CONSTANTS = load_constants()
_SPEEDS = np.geomspace(0.01, 0.4, 30)  # rad/s


@dataclass(frozen=True, slots=True)
class CalibrationErrors:
    """Errors of one calibration by joint, shapes (7,).

    Attributes:
        coulomb: relative.
        asymmetry: as a share of Coulomb friction.
        breakaway: relative, with its sign.
        curve: largest relative one of the torque over 0.01 to 0.4 rad/s.
    """

    coulomb: np.ndarray
    asymmetry: np.ndarray
    breakaway: np.ndarray
    curve: np.ndarray


@dataclass(frozen=True, slots=True)
class Verdict:
    """One bound, held against the calibrations of a share.

    Attributes:
        name: what is bounded.
        values: the worst of the seeds, or their median, by joint, shape (7,).
        bounds: shape (7,).
    """

    name: str
    values: np.ndarray
    bounds: np.ndarray

    @property
    def is_met(self) -> bool:
        return bool((self.values < self.bounds).all())


def errors_of(found: Path, true: Path) -> CalibrationErrors:
    """Return the errors of a calibration.

    Args:
        found: the file of the calibration.
        true: what the simulated arm really has.
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
    """Return the bounds of one share; of break-away the median over seeds counts."""
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


def calibrate(folder: Path, share: float, seed: int) -> tuple[Path, Path]:
    """Calibrate a simulated arm, if `folder` lacks it; return both files.

    Raises:
        CalledProcessError: the calibration was refused.
    """
    found, true = folder / "friction.fake.toml", folder / "friction.truth.toml"
    if true.exists():
        return found, true
    program = [sys.executable, "-m", "experiments"]
    subprocess.run([*program, "init", str(folder)], check=True, capture_output=True)
    options = ["--fake", "--fast", "--operator-script", "auto"]
    options += ["--config", str(folder / "rig.toml"), "--data", str(folder / "data")]
    options += ["--friction", str(share), "--seed", str(seed)]
    words = [*program, "calibrate", "friction", *options]
    subprocess.run(words, check=True, capture_output=True)
    return found, true


def rows_of(share: float, shown: Sequence[Verdict]) -> list[str]:
    """Return the lines of a table for one share."""
    return [
        f"| {share:g} | {each.name} | "
        + " | ".join(f"{100 * value:.1f}" for value in each.values)
        + f" | {'met' if each.is_met else '**missed**'} |"
        for each in shown
    ]


def page_part(seeds: Sequence[int], rows: Sequence[str]) -> str:
    """Return what stands in docs/friction.md."""
    head = ["friction", "error [%]", *(f"joint {j}" for j in range(1, 8)), "bound"]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head), *rows]
    return (
        "`python -m studies.friction_calibrations --write docs/friction.md`: "
        f"{len(seeds)} arms drawn at each share (seeds "
        f"{', '.join(map(str, seeds))}), each calibrated through the whole program.\n\n"
        + "\n".join(lines)
        + "\n\nThe worst of the seeds; of break-away their median. Bounds: Coulomb "
        f"{COULOMB:.0%} of every joint, asymmetry {ASYMMETRY:.0%} of Coulomb, torque "
        f"over 0.01 to 0.4 rad/s {CURVE[0]:.0%} on joints 1 to 4 and {CURVE[-1]:.0%} "
        f"on 5 to 7, break-away {BREAKAWAY:.0%}. Joint 7 turns at 0.5 rad/s in every "
        "move, or a frozen encoder would let it be thrown: how it breaks away is seen "
        "within 20 ms only, and its slow friction is extrapolated.\n"
    )


def main() -> int:
    """Calibrate, print the table, return 1 where a bound is exceeded."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shares", type=float, nargs="+", default=SHARES)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--keep", type=Path, help="folder of the calibrations")
    parser.add_argument("--write", type=Path, help="page whose part is written")
    options = parser.parse_args()
    rows, missed = list[str](), 0
    with tempfile.TemporaryDirectory() as scratch:
        root = options.keep or Path(scratch)
        for share in options.shares:
            folders = [root / f"{share:g}-{seed}" for seed in options.seeds]
            pairs = zip(folders, options.seeds, strict=True)
            files = [calibrate(folder, share, seed) for folder, seed in pairs]
            shown = verdicts([errors_of(*pair) for pair in files])
            missed += sum(not each.is_met for each in shown)
            rows += rows_of(share, shown)
            print(*rows[-len(shown) :], sep="\n", flush=True)
    if options.write is not None:
        old = options.write.read_text() if options.write.exists() else ""
        part = page_part(options.seeds, rows)
        options.write.write_text(with_calibrations(old, part))
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
