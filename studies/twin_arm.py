"""The twin of a simulated arm held against the arm itself, on a way of its own.

python -m studies.twin_arm [--share 0.4] [--seed 3] [--seconds 20] [--keep FOLDER]

Calibrates gravity and friction of a simulated arm whose friction was drawn, builds the
twin from the files, and lets both follow a way that no calibration went. Prints, by
joint, how much the torques differ in percent of Coulomb friction, and how far the twin
is off after half a second under the torques of the arm. Exits with 1 beyond 10 % or
5 mrad.
"""

import argparse
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from experiments.rig.fake import SimulatedRig
from experiments.rig.law_calibrations import read_law_calibrations
from experiments.settings.load import load_settings
from fakes.plant.model import PlantOptions
from fakes.plant.plant import ArmPlant
from fakes.world.plain_world import arm_of
from tests.fakes.scenes import (
    CONSTANTS,
    CYCLE_NS,
    FRAME,
    MODEL,
    TOOL,
    release,
    send,
)
from wam.model.friction import friction_of

MOST_TORQUE, MOST_WAY = 0.1, 5e-3  # of Coulomb friction; rad
_WINDOW, _JOINED = 250, 150  # cycles on its own, and led to the arm before that
_START_Q = np.array([0.2, 0.2, -0.1, 1.8, 0.2, 0.5, 0.3])
_TONES = np.array([0.11, 0.23, 0.41, 0.67])  # Hz
_SWING = np.array([0.25, 0.08, 0.25, 0.08, 0.35, 0.10, 0.35])  # rad


@dataclass(frozen=True, slots=True)
class FollowedWay:
    """What an arm did, shapes (n, 7): q [rad], qd [rad/s] and torques [N m]."""

    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray


def free_arm(constants, options):
    """Return a released arm that nobody holds, above nothing."""
    plant = ArmPlant(constants, TOOL, FRAME, _START_Q, replace(options, has_hand=False))
    release(plant)
    return plant


def twin_of(folder: Path):
    """Return the twin that the calibrations in `folder` describe."""
    settings = load_settings(folder / "rig.toml")
    known = read_law_calibrations(settings, is_twin=True)
    row = settings.matrix.terrains[0]
    world = SimulatedRig(settings.rig, row, 1, 0.02, "steady", twin=known)
    constants, motors = arm_of(world.metadata()["body"], CONSTANTS)
    return free_arm(constants, PlantOptions(motors=motors))


def wanted(seconds: float, start: np.ndarray) -> np.ndarray:
    """Return a way that begins at rest at `start`, shape (n, 7) [rad]."""
    t = np.arange(round(seconds * 500)) / 500.0
    phases = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, (7, len(_TONES)))
    way = np.sin(2.0 * np.pi * _TONES * t[:, None, None] + phases).mean(axis=2)
    begun = np.clip(t / 2.0, 0.0, 1.0)[:, None]
    return start + _SWING * begun**2 * (3.0 - 2.0 * begun) * way


def servo(plant: ArmPlant, goal: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return the torques that lead the arm to `goal` [N m]."""
    led = CONSTANTS.kp * (goal - plant.q) + CONSTANTS.kd * (speed - plant.qd)
    return MODEL.gravity(plant.q) + led


def follow(plant: ArmPlant, way: np.ndarray) -> FollowedWay:
    """Let the arm follow `way` and return what it did."""
    speeds = np.gradient(way, 1.0 / 500.0, axis=0)
    done: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for goal, speed in zip(way, speeds, strict=True):
        tau = servo(plant, goal, speed)
        done.append((plant.q.copy(), plant.qd.copy(), tau))
        step(plant, tau)
    return FollowedWay(*(np.array(column) for column in zip(*done, strict=True)))


def step(plant: ArmPlant, tau: np.ndarray) -> None:
    """Let a cycle pass under `tau`."""
    send(plant, tau)
    plant.advance(plant.t_ns + CYCLE_NS)


def torque_error(arm: FollowedWay, twin: FollowedWay, coulomb: np.ndarray):
    """Return the rms of what the torques differ by, of Coulomb friction, shape (7,)."""
    return np.sqrt(np.mean((arm.tau - twin.tau) ** 2, axis=0)) / coulomb


def window_errors(plant: ArmPlant, arm: FollowedWay) -> np.ndarray:
    """Return how far the twin is off at the end of each window [rad], shape (n, 7).

    Before each it is led along the arm's way, so that its bristles are bent alike.
    """
    errors: list[np.ndarray] = []
    for first in range(0, len(arm.q) - _JOINED - _WINDOW, _JOINED + _WINDOW):
        begin = first + _JOINED
        if not errors:
            plant.q = arm.q[first].copy()
        for i in range(first, begin):
            step(plant, servo(plant, arm.q[i], arm.qd[i]))
        plant.q = arm.q[begin].copy()
        plant.qd[:] = arm.qd[begin]
        for tau in arm.tau[begin : begin + _WINDOW]:
            step(plant, tau)
        errors.append(plant.q - arm.q[begin + _WINDOW])
        plant.q = arm.q[begin + _WINDOW].copy()
        plant.qd[:] = arm.qd[begin + _WINDOW]
    return np.array(errors)


def calibrate(folder: Path, share: float, seed: int) -> None:
    """Calibrate gravity and friction of a simulated arm into `folder`.

    Raises:
        CalledProcessError: a calibration was refused.
    """
    program = [sys.executable, "-m", "experiments"]
    subprocess.run([*program, "init", str(folder)], check=True, capture_output=True)
    options = ["--fake", "--fast", "--operator-script", "auto"]
    options += ["--config", str(folder / "rig.toml"), "--data", str(folder / "data")]
    options += ["--friction", str(share), "--seed", str(seed)]
    path = folder / "rig.toml"
    for what in ("gravity", "friction"):
        words = [*program, "calibrate", what, *options]
        subprocess.run(words, check=True, capture_output=True)
        text = path.read_text().replace(f'"{what}.toml"', f'"{what}.fake.toml"')
        path.write_text(text.replace('model = "cad"', 'model = "calibrated"'))


def compare(folder: Path, seconds: float):
    """Return (torque errors, shape (7,), errors of the windows, shape (n, 7))."""
    truth = tomllib.loads((folder / "friction.truth.toml").read_text())
    options = PlantOptions(motors=friction_of(truth["motors"]))
    real = free_arm(CONSTANTS, options)
    way = wanted(seconds, real.q.copy())
    arm = follow(real, way)
    twin = follow(twin_of(folder), way)
    errors = torque_error(arm, twin, np.array(truth["coulomb"]))
    return errors, window_errors(twin_of(folder), arm)


def main() -> int:
    """Calibrate, compare, print; return 1 beyond a bound."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=0.4)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--keep", type=Path, help="folder of the calibrations")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch)
        if not (folder / "friction.truth.toml").exists():
            calibrate(folder, given.share, given.seed)
        torque, ways = compare(folder, given.seconds)
    rms, worst = np.sqrt(np.mean(ways**2, axis=0)), np.abs(ways).max(axis=0)
    print("torque, % of Coulomb:", np.round(100 * torque, 1))
    print("windows, rms [mrad]: ", np.round(1e3 * rms, 2))
    print("windows, worst [mrad]:", np.round(1e3 * worst, 2), len(ways))
    return int(bool((torque > MOST_TORQUE).any() or (rms > MOST_WAY).any()))


if __name__ == "__main__":
    sys.exit(main())
