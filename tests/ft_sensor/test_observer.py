from dataclasses import replace

import numpy as np
import pytest

from acquisition.devices import ArmReading, WrenchSample
from acquisition.sample import Sample
from ft_sensor.payload import LiveFoot, TerrainFrame, payload_of, traction

Q = np.array([0.2, 0.9, -0.1, 1.6, 0.1, np.pi - 2.5, 0.3])
QD = np.array([0.1, -0.2, 0.3, 0.1, -0.4, 0.2, 0.5])
RAW = (1.0, -2.0, 9.0, 0.1, 0.2, -0.3)
TERRAIN = TerrainFrame(np.deg2rad(10.0), 0.2, (0.9, 0.1, -0.3), 0.45)
EXACT = 1e-12


def reading(q=Q, qd=QD):
    return ArmReading(
        host_ns=1,
        arm_ns=1,
        counts=[0] * 7,
        q=q,
        qd=qd,
        qd7_raw=0.0,
        fresh=0x7F,
        is_complete=True,
        missing_cycles=0,
    )


def wrench(values=RAW):
    return WrenchSample(1, 0, values, 0, True, False)


@pytest.fixture(scope="module")
def payload(example_tool):
    payload = payload_of(replace(example_tool, sensor_angle=0.4, sensor_sign=-1.0))
    return replace(payload, bias=np.arange(6.0) / 10)


@pytest.fixture
def foot(foot_model, payload):
    return LiveFoot(foot_model, payload, TERRAIN)


@pytest.fixture
def sample():
    return Sample()


def test_the_pose_of_the_foot_is_that_of_the_sole(foot, foot_model, sample):
    foot.observe(reading(), wrench(), sample)
    position, _ = foot_model.sole_pose(Q)
    assert np.allclose(sample.foot_position, position, atol=EXACT)
    assert np.linalg.norm(sample.foot_orientation) == pytest.approx(1.0, abs=EXACT)


def test_the_twist_and_the_speed_are_those_of_the_sole(foot, foot_model, sample):
    speed = foot.observe(reading(), wrench(), sample)
    twist = foot_model.sole_jacobian(Q) @ QD
    assert np.allclose(sample.foot_velocity, twist, atol=EXACT)
    assert speed == pytest.approx(np.linalg.norm(twist[:3]), abs=EXACT)


def test_live_values_agree_with_the_analysis(foot, foot_model, payload, sample):
    foot.observe(reading(), wrench(), sample)
    _, rotation = foot_model.sole_pose(Q)
    contact = payload.contact(np.array(RAW), rotation)
    force = payload.to_base(contact, rotation)
    velocity = foot_model.sole_jacobian(Q)[:3] @ QD
    assert np.allclose(sample.wrench_raw, RAW, atol=0.0)
    assert np.allclose(sample.wrench, contact, atol=EXACT)
    expected = traction(TERRAIN.axes(), velocity, force)
    assert np.allclose(sample.traction, expected, atol=EXACT)


def test_without_a_fresh_wrench_the_forces_repeat_and_the_motion_does_not(foot, sample):
    foot.observe(reading(), wrench(), sample)
    kept = sample.wrench.copy(), sample.wrench_raw.copy(), sample.traction[1:].copy()
    v_t = float(sample.traction[0])
    foot.observe(reading(qd=2 * QD), None, sample)
    assert np.array_equal(sample.wrench, kept[0])
    assert np.array_equal(sample.wrench_raw, kept[1])
    assert np.array_equal(sample.traction[1:], kept[2])
    assert sample.traction[0] == pytest.approx(2 * v_t, abs=EXACT)


def test_before_the_first_wrench_there_is_motion_and_no_force(foot, sample):
    foot.observe(reading(), None, sample)
    assert np.isnan(sample.wrench).all()
    assert np.isnan(sample.traction[1:]).all()
    assert np.isfinite(sample.traction[0])
    assert np.isfinite(sample.foot_position).all()


def test_a_tare_takes_effect_in_the_next_cycle(foot, foot_model, payload, sample):
    _, rotation = foot_model.sole_pose(Q)
    foot.payload = payload.tared(np.array(RAW), rotation)
    foot.observe(reading(), wrench(), sample)
    assert np.allclose(sample.wrench, 0.0, atol=EXACT)
    assert np.allclose(sample.traction[1:], 0.0, atol=EXACT)


def test_a_resting_foot_has_no_speed(foot, sample):
    assert foot.observe(reading(qd=np.zeros(7)), wrench(), sample) == 0.0
    assert sample.traction[0] == 0.0
