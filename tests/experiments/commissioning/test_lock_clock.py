"""C12: lag, stiffness and ringing are recovered from synthetic signals."""

import numpy as np
import pytest

from experiments.commissioning import lock_clock
from experiments.commissioning.recording import texts
from experiments.commissioning.weights import POSES
from fakes.plant.gauges import WristGauges
from tests.fakes.scenes import TOOL
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants

MODEL = ArmModel(load_constants(), TOOL)
UP = np.array([0.0, 0.0, 1.0])


def rocked(lag=0.0, amplitude=0.3, seconds=10.0):
    """Recording of a foot that is rocked about joint 6 at 1 Hz."""
    gauges, t = WristGauges(TOOL, UP, 0.002), np.arange(0.0, seconds, 0.002)
    q = np.tile(np.array(POSES[1], dtype=np.float64), (len(t), 1))
    q[:, 5] += amplitude * np.sin(2.0 * np.pi * t)
    qd = np.gradient(q, 0.002, axis=0)
    loads = []
    for position, speed in zip(q, qd, strict=True):
        rates = MODEL.sole_jacobian(position) @ speed
        gauges.end_cycle(MODEL.plate_pose(position)[1], [0.0] * 6, rates.tolist())
        loads.append(gauges.load())
    t_ns = np.round(1e9 * (t + 1.0)).astype(np.int64)
    rng = np.random.default_rng(1)
    return {
        "t_ns": t_ns,
        "q": q,
        "wrench_ns": t_ns + round(1e9 * lag),
        "wrench": np.array(loads) + 0.05 * rng.standard_normal((len(t), 6)) + 3.0,
    }


def turned(stiffness=20.0, moment=0.6, back=0.0, friction=0.0):
    """Recording of a foot that is turned by half of a moment, by all, and released."""
    half, amplitude = ((m - friction) / stiffness for m in (moment / 2.0, moment))
    rest = np.zeros(900)
    swing = amplitude * np.exp(-np.arange(100) / 20.0)
    swing[50] = -back * amplitude
    return {
        "turned": 0.1 + np.array([half, amplitude, 0.0]),
        "moments": np.array([[0, 0, 0.02 + m] for m in (moment / 2.0, moment, 0.0)]),
        "swing_q7": np.concatenate([swing, rest]) + 0.1,
        "ended": texts([]),
        "sign": np.array(1.0),
        "mounting": np.eye(3),
    }


def cause(**changed):
    return lock_clock.judge({**rocked(), **turned(), **changed}).cause


@pytest.mark.parametrize("lag", [-0.004, 0.0, 0.002, 0.02])
def test_the_lag_of_the_sensor_is_recovered(lag):
    seen, _ = lock_clock.force_lag({**rocked(lag), **turned()})
    # The model is linear in the lag: a large one comes out 7 % too large.
    assert seen == pytest.approx(lag, abs=5e-4, rel=0.08)


def test_a_sound_arm_passes():
    assert cause() == ""


@pytest.mark.parametrize("lag", [-0.006, 0.006, 0.02])
def test_a_lag_of_the_forces_is_reported(lag):
    assert cause(**rocked(lag)).startswith("delay of forces")


def test_a_foot_that_was_hardly_rocked_is_reported():
    assert cause(**rocked(amplitude=0.05)).startswith("swing of the foot's weight")


def test_a_recording_without_sensor_readings_fails():
    nothing = {"wrench_ns": np.zeros(0), "wrench": np.zeros((0, 6))}
    assert cause(**nothing).startswith("swing of the foot's weight")


@pytest.mark.parametrize("stiffness", [9.5, 15.0, 29.0])
def test_a_lock_of_another_stiffness_is_reported(stiffness):
    assert cause(**turned(stiffness)).startswith("stiffness of joint 7's lock")


def test_friction_does_not_change_the_stiffness():
    stiffness, moment = lock_clock.lock_stiffness(turned(friction=0.25))
    assert (stiffness, moment) == pytest.approx((20.0, 0.3))


def test_an_oscillating_lock_is_reported():
    assert cause(**turned(back=0.6)).startswith("overshoot after the release")
    assert cause(**turned(back=0.3)) == ""


def test_too_small_a_moment_is_reported():
    assert cause(**turned(moment=0.1)).startswith("moment that turned the foot")


def test_the_message_of_a_guard_stop_is_the_cause():
    stopped = {"ended": texts(["The speed of joint 7 was 2.6 rad/s."])}
    assert "The speed of joint 7" in cause(**stopped)
