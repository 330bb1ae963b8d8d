"""The limits of the arm follow from rig.toml and the arm's constants."""

import numpy as np

from experiments.rig.build import build_limits, build_walls
from experiments.settings.load import load_settings
from wam.driver.settings import ArmSettings
from wam.model.constants import load_constants

RIG = load_settings(None).rig
CONSTANTS = load_constants()


def test_the_guard_has_the_limits_of_rig_toml():
    limits = build_limits(RIG, CONSTANTS)
    assert tuple(limits.torque) == tuple(RIG.limits.torque)
    assert tuple(limits.speed) == tuple(RIG.limits.speed)
    assert limits.foot_speed == RIG.limits.foot_speed
    assert np.array_equal(limits.q_lower, CONSTANTS.q_lower)
    assert np.array_equal(limits.q_upper, CONSTANTS.q_upper)


def test_the_walls_brake_with_the_damping_of_the_arm_and_push_within_its_limits():
    walls = build_walls(RIG, CONSTANTS)
    assert np.array_equal(walls.damping, CONSTANTS.kd)
    assert tuple(walls.torque) == tuple(RIG.limits.torque)
    assert np.array_equal(walls.lower, CONSTANTS.q_lower)
    assert np.array_equal(walls.upper, CONSTANTS.q_upper)


def test_the_host_clips_torque_at_or_below_the_clamp_of_the_pucks():
    own = ArmSettings().torque_limits
    assert all(most <= clamp for most, clamp in zip(own, CONSTANTS.mt, strict=True))


def test_the_host_allows_the_motors_the_torque_of_every_joint_limit():
    """Half of the limits would be as wrong as twice: joint 2 alone takes most."""
    own = np.array(ArmSettings().torque_limits)
    units = (
        CONSTANTS.ipnm * np.linalg.solve(CONSTANTS.j2mp.T, np.diag(RIG.limits.torque)).T
    )
    assert (np.abs(units).max(axis=0) <= own).all()
