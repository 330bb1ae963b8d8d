"""Position hold in the loop of 500 Hz is stable and damped in every pose.

The loop as a linear map of one cycle: joints with the drives' inertia and without any
friction, the driver's filter of velocities, torques that arrive half a cycle after the
positions they follow from.
"""

import importlib

import numpy as np
import pytest

from experiments.settings.rig import LOCK_DAMPING, ControlSection
from fakes.plant.model import arm_and_hand
from tests.fakes.scenes import CONSTANTS, FRAME, START_Q, TOOL
from wam.control.joint_lock import LockGains
from wam.control.position_control import PositionHold
from wam.driver.settings import ArmSettings
from wam.model.arm_model import drive_inertia_matrix

T, DELAY = 0.002, 0.5  # s; share of a cycle
LOCK = LockGains()
# Damping ratios in the worst of all poses; joint 7 has a separate, fast lock.
DAMPED, DAMPED_FAST, FAST = 0.28, 0.18, 60.0  # FAST: rad/s
DAMPED_GUIDE = 0.07
pin = importlib.import_module("pinocchio")


def inertia(q):
    """Return the inertia of joints and drives, shape (7, 7)."""
    model = arm_and_hand(CONSTANTS, TOOL, FRAME)[0]
    model.armature = np.zeros(7)
    upper = np.triu(pin.crba(model, model.createData(), q))
    return upper + np.triu(upper, 1).T + drive_inertia_matrix(CONSTANTS)


HOLD = PositionHold(CONSTANTS)


def gains(scale, damping, lock):
    """Return (stiffness, damping, damping on the raw velocity), shape (7, 7) each."""
    k, d = (np.diag(scale * g) for g in (HOLD.stiffness, damping))
    raw = np.zeros((7, 7))
    k[6, 6], raw[6, 6] = lock.kp, lock.kd
    return k, d, raw


def modes(q, scale, damping=HOLD.damping, lock=LOCK, delay=DELAY):
    """Return the logarithms of the cycle's eigenvalues over time [1/s]."""
    one, none = np.eye(7), np.zeros((7, 7))
    k, d, raw = gains(scale, damping, lock)
    share = ArmSettings().velocity_pole * T
    share /= 1.0 + share
    # State: q, qd, q before, filtered velocity before, torque before.
    position = np.hstack([one, none, none, none, none])
    filtered = np.hstack(
        [share / T * one, none, -share / T * one, (1 - share) * one, none]
    )
    difference = np.hstack([one / T, none, -one / T, none, none])
    torque = -k @ position - d @ filtered - raw @ difference
    before = np.hstack([none, none, none, none, one])
    velocity = np.hstack([none, one, none, none, none])
    early, late = delay * T, (1 - delay) * T
    mobility = np.linalg.inv(inertia(q))
    step = np.vstack(
        [
            position
            + T * velocity
            + mobility @ (early * (T - early / 2) * before + late**2 / 2 * torque),
            velocity + mobility @ (early * before + late * torque),
            position,
            filtered,
            torque,
        ]
    )
    values = np.linalg.eigvals(step)
    return np.log(values[np.abs(values) > 1e-6].astype(complex)) / T


def poses():
    rng = np.random.default_rng(7)
    random = rng.uniform(CONSTANTS.q_lower, CONSTANTS.q_upper, (60, 7))
    return [START_Q, np.zeros(7), CONSTANTS.home, *random]


def test_every_motion_in_every_pose_is_damped():
    for q in poses():
        s = modes(q, 1.0)
        swinging = s[np.abs(s.imag) > 1.0]
        assert s.real.max() < 0.0
        damped = -swinging.real / np.abs(swinging)
        assert damped.min() > DAMPED_FAST
        assert damped[np.abs(swinging) < FAST].min(initial=1.0) > DAMPED


def test_a_guided_arm_is_stable_in_every_pose():
    for q in poses():
        s = modes(q, 1.0, HOLD.guide_damping)
        swinging = s[np.abs(s.imag) > 1.0]
        assert (-swinging.real / np.abs(swinging)).min() > DAMPED_GUIDE


def test_hold_gains_have_a_stability_margin():
    assert max(modes(q, 2.0).real.max() for q in poses()) < 0.0
    assert max(modes(q, 6.0).real.max() for q in poses()) > 0.0


def growth(kp, kd):
    """Return the growth rate of the worst motion [1/s], with torques one cycle late."""
    lock = LockGains(kp=kp, kd=kd)
    return max(modes(q, 1.0, lock=lock, delay=1.0).real.max() for q in poses())


def test_every_configurable_lock_is_stable_with_a_cycle_of_delay():
    fields = ControlSection.model_fields
    kp, kd = (
        next(c.le for c in fields[name].metadata if hasattr(c, "le"))
        for name in ("lock_kp", "lock_kd")
    )
    for stiffness in (0.25 * kp, 0.5 * kp, 0.75 * kp, kp):
        for damping in (LOCK_DAMPING * stiffness, kd):
            assert growth(stiffness, damping) < -1.0
    assert growth(30.0, 0.25) > 0.0  # allowed in the past
    assert growth(kp, 0.5 * LOCK_DAMPING * kp) > 0.0


def test_the_inertia_is_positive_and_plausible():
    drives = drive_inertia_matrix(CONSTANTS)
    assert (np.linalg.eigvalsh(inertia(START_Q) - drives) > 0.0).all()
    assert inertia(START_Q)[1, 1] == pytest.approx(2.75, abs=0.1)
