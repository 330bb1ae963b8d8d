import numpy as np
import pytest

from wam.model.constants import load_constants
from wam.model.friction import (
    MotorFriction,
    friction_of,
    joint_coulomb,
    motor_shares,
    plastic_share,
)

CONSTANTS = load_constants()


def example(**changed):
    values = {
        "coulomb": np.linspace(0.02, 0.08, 7),
        "asymmetry": np.linspace(-0.004, 0.004, 7),
        "load": np.full(7, 0.02),
        "load_at": np.full(7, 0.1),
        "breakaway": np.full(7, 1.3),
        "stribeck": np.full(7, 0.5),
        "viscous": np.full(7, 1e-4),
        "ripple_sin": np.full(7, 0.03),
        "ripple_cos": np.full(7, -0.02),
        "presliding": np.full(7, 0.03),
    }
    return MotorFriction(**{**values, **changed})


def test_joint_friction_is_recovered_from_the_motors_that_share_it():
    motors = motor_shares(CONSTANTS, CONSTANTS.coulomb, 1)
    assert (motors > 0.0).all()
    # joints 2 and 3 were identified with one figure for both of their motors
    assert joint_coulomb(CONSTANTS, motors) == pytest.approx(
        CONSTANTS.coulomb, rel=0.01
    )


def test_steady_friction_opposes_the_motion_and_falls_from_breakaway():
    friction, still = example(), np.zeros(7)
    load_torque = np.full(7, 0.1)
    slow = friction.steady(still, load_torque, np.full(7, 1e-6))
    fast = (
        friction.steady(still, load_torque, np.full(7, 50.0)) - 50.0 * friction.viscous
    )
    level = (friction.coulomb + friction.asymmetry) * (1.0 + friction.ripple_cos)
    assert slow == pytest.approx(1.3 * level)
    assert fast == pytest.approx(level, rel=1e-3)
    back = friction.steady(still, load_torque, np.full(7, -1e-6))
    other = (friction.coulomb - friction.asymmetry) * (1.0 + friction.ripple_cos)
    assert back == pytest.approx(-1.3 * other)


def test_a_loaded_motor_has_more_friction():
    friction, still = example(), np.zeros(7)
    speed = np.full(7, 50.0)
    more = friction.steady(still, np.full(7, -1.1), speed)
    less = friction.steady(still, np.full(7, 0.1), speed)
    growth = 0.02 * 1.0 * (1.0 + friction.ripple_cos)
    assert more - less == pytest.approx(growth, rel=1e-3)


def test_breakaway_excess_falls_to_half_at_the_stribeck_speed():
    friction, still = example(), np.zeros(7)
    load_torque = np.full(7, 0.1)
    slow, half, fast = (
        friction.steady(still, load_torque, np.full(7, v)) - v * friction.viscous
        for v in (1e-9, 0.5, 1e6)
    )
    assert half == pytest.approx(0.5 * (slow + fast))


@pytest.mark.parametrize(
    ("deflection", "share"),
    [(0.0, 0.0), (0.7, 0.0), (0.85, 0.5), (1.0, 1.0), (1.4, 1.0)],
)
def test_a_bristle_bends_elastically_and_slides_at_its_full_deflection(
    deflection, share
):
    assert plastic_share(deflection) == pytest.approx(share)


def test_friction_round_trips_through_plain_values():
    before = example()
    after = friction_of(before.metadata())
    for name in MotorFriction.__slots__:
        assert (getattr(after, name) == getattr(before, name)).all()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("coulomb", [0.0] * 7),
        ("breakaway", [0.9] * 7),
        ("viscous", [float("nan")] * 7),
        ("load", [0.1] * 6),
        ("stribeck", [-1.0] * 7),
    ],
)
def test_implausible_friction_is_refused(name, value):
    with pytest.raises(ValueError, match=r"expected|above 0|or more"):
        friction_of({**example().metadata(), name: value})
