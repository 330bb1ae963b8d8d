import numpy as np
import pytest

from acquisition.cycle import ArmState
from acquisition.devices import ArmReading
from wam.controller import FootController
from wam.gravity import compensation
from wam.joint_lock import LockGains

S = 1_000_000_000
DOWN = np.array([0, 0.9, 0, 1.6, 0, np.pi - 2.5, 0.2])
MASS = 0.3


def reading(seconds, *, q=DOWN, qd=None, qd7_raw=0.0):
    return ArmReading(
        host_ns=int(seconds * S),
        arm_ns=0,
        counts=[0] * 7,
        q=q,
        qd=np.zeros(7) if qd is None else qd,
        qd7_raw=qd7_raw,
        fresh=0x7F,
        is_complete=True,
        missing_cycles=0,
    )


@pytest.fixture
def law(foot_model):
    return FootController(foot_model, MASS)


def moved(joint7):
    q = DOWN.copy()
    q[6] += joint7
    return q


def test_floating_is_gravity_and_nothing_else(law, foot_model):
    law.enter(ArmState.FLOAT, reading(0.0))
    tau, gravity = law.torque(reading(0.0))
    assert np.array_equal(tau, gravity)
    assert np.array_equal(gravity, compensation(foot_model, DOWN, 0.0))


@pytest.mark.parametrize(("seconds", "mass"), [(1.0, 0.15), (2.0, 0.3), (60.0, 0.3)])
def test_the_virtual_mass_comes_in_two_seconds(law, foot_model, seconds, mass):
    law.enter(ArmState.FLOAT, reading(0.0))
    gravity = law.torque(reading(seconds))[1]
    assert np.allclose(gravity, compensation(foot_model, DOWN, mass), atol=1e-12)


@pytest.mark.parametrize("state", [ArmState.HOLD, ArmState.DAMP])
def test_the_virtual_mass_leaves_in_two_seconds(law, foot_model, state):
    law.enter(ArmState.FLOAT, reading(0.0))
    law.enter(state, reading(10.0))
    for seconds, mass in ((10.0, 0.3), (11.0, 0.15), (12.0, 0.0), (99.0, 0.0)):
        gravity = law.torque(reading(seconds))[1]
        assert np.allclose(gravity, compensation(foot_model, DOWN, mass), atol=1e-12)


def test_floating_has_no_damping_but_at_joint_7(law):
    law.enter(ArmState.FLOAT, reading(0.0))
    qd = np.full(7, 0.5)
    tau, gravity = law.torque(reading(5.0, qd=qd))
    assert np.array_equal(tau[:6], gravity[:6])


@pytest.mark.parametrize("state", [ArmState.HOLD, ArmState.DAMP])
def test_holding_and_damping_brake_every_joint(law, foot_model, state):
    law.enter(state, reading(0.0))
    qd = np.linspace(-1.0, 1.0, 7) + 0.1
    tau, gravity = law.torque(reading(5.0, qd=qd))
    kd = foot_model.constants.kd
    assert np.allclose(tau[:6] - gravity[:6], -kd[:6] * qd[:6], atol=1e-12)
    assert ((tau[:6] - gravity[:6]) * qd[:6] < 0.0).all()


def test_torques_do_not_jump_from_float_to_hold_at_rest(law):
    law.enter(ArmState.FLOAT, reading(0.0))
    before = law.torque(reading(5.0, q=moved(0.01)))[0]
    law.enter(ArmState.HOLD, reading(5.0, q=moved(0.01)))
    after = law.torque(reading(5.0, q=moved(0.01)))[0]
    assert np.allclose(before, after, atol=1e-12)


@pytest.mark.parametrize("state", [ArmState.FLOAT, ArmState.HOLD, ArmState.DAMP])
def test_joint_7_is_locked_where_it_was(law, state):
    law.enter(state, reading(0.0))
    tau, gravity = law.torque(reading(5.0, q=moved(0.01)))
    assert tau[6] - gravity[6] == pytest.approx(-0.2, abs=1e-12)
    assert law.joint7_offset(reading(5.0, q=moved(0.01))) == pytest.approx(0.01)


def test_the_lock_is_damped_on_the_raw_difference(law):
    law.enter(ArmState.HOLD, reading(0.0))
    qd = np.full(7, 3.0)  # the filtered velocity must not matter
    tau, gravity = law.torque(reading(5.0, qd=qd, qd7_raw=1.0))
    assert tau[6] - gravity[6] == pytest.approx(-0.2, abs=1e-12)


def test_the_lock_keeps_its_place_from_float_to_hold(law):
    law.enter(ArmState.FLOAT, reading(0.0))
    law.enter(ArmState.HOLD, reading(5.0, q=moved(0.03)))
    assert law.joint7_offset(reading(5.0, q=moved(0.03))) == pytest.approx(0.03)


@pytest.mark.parametrize("state", [ArmState.IDLE, ArmState.UNKNOWN])
def test_idle_lets_joint_7_go(law, state):
    law.enter(ArmState.FLOAT, reading(0.0))
    law.enter(state, reading(1.0))
    assert law.joint7_offset(reading(1.0, q=moved(0.5))) == 0.0


def test_the_torque_given_out_may_be_changed_by_its_owner(law):
    law.enter(ArmState.FLOAT, reading(0.0))
    tau, gravity = law.torque(reading(1.0))
    kept = gravity.copy()
    tau += 1.0
    assert np.array_equal(gravity, kept)


def test_the_gains_of_the_lock_can_be_chosen(foot_model):
    law = FootController(foot_model, MASS, LockGains(kp=8.0))
    law.enter(ArmState.FLOAT, reading(0.0))
    tau, gravity = law.torque(reading(5.0, q=moved(0.01)))
    assert tau[6] - gravity[6] == pytest.approx(-0.08, abs=1e-12)
