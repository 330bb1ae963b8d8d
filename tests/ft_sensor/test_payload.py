from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ft_sensor.payload import (
    Payload,
    TerrainFrame,
    cross_matrix,
    payload_of,
    traction,
)
from wam.model.constants import GRAVITY

EXACT = 1e-12  # rounding of numbers of order 10
INCLINES = [0.0, 10.0, 15.0]


def rotation(axis, angle):
    """Return the turn about `axis` (0, 1, 2) by `angle` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


def attitude(roll, pitch, yaw):
    return rotation(2, yaw) @ rotation(1, pitch) @ rotation(0, roll)


FOOT_DOWN = rotation(1, np.pi)  # diag(-1, 1, -1)


def mounted(tool, angle=0.0, sign=1.0, bias=0.0):
    payload = payload_of(replace(tool, sensor_angle=angle, sensor_sign=sign))
    return replace(payload, bias=np.full(6, bias) * np.arange(1, 7))


def reading(payload, R_base_7, force, tool, point=None):
    """Return the reading when the ground pushes with `force` (base frame).

    Built from the statics of a body hung on the sensor, without the code under test.
    """
    R = R_base_7 @ rotation(2, tool.sensor_angle)
    weight = np.array([0.0, 0.0, -GRAVITY * tool.foot.mass])
    origin = R_base_7 @ np.array([0.0, 0.0, tool.sensor_height])
    com = R_base_7 @ tool.foot.com - origin
    lever = R_base_7 @ (tool.sole if point is None else point) - origin
    moment = np.cross(com, weight) + np.cross(lever, force)
    load = np.concatenate([R.T @ (weight + force), R.T @ moment])
    return tool.sensor_sign * load + payload.bias


angles = st.floats(-np.pi, np.pi)
newtons = st.floats(-50, 50)


@given(
    turns=st.tuples(angles, angles, angles),
    psi=angles,
    sign=st.sampled_from([1.0, -1.0]),
    bias=st.floats(-20, 20),
    force=st.tuples(newtons, newtons, newtons),
)
def test_the_ground_force_is_recovered_from_the_reading(
    example_tool, turns, psi, sign, bias, force
):
    tool = replace(example_tool, sensor_angle=psi, sensor_sign=sign)
    payload = mounted(tool, psi, sign, bias)
    R = attitude(*turns)
    contact = payload.contact(reading(payload, R, np.array(force), tool), R)
    assert np.allclose(payload.to_base(contact, R), force, atol=1e-11)


def test_the_remaining_moment_is_that_of_the_ground_force(example_tool):
    force = np.array([3.0, -2.0, 12.0])
    payload = mounted(example_tool)
    R = attitude(0.1, np.pi - 0.2, 0.5)
    contact = payload.contact(reading(payload, R, force, example_tool), R)
    lever = example_tool.sole - [0.0, 0.0, example_tool.sensor_height]
    assert np.allclose(contact[3:], np.cross(lever, R.T @ force), atol=EXACT)


def test_a_foot_in_the_air_has_no_ground_force(example_tool):
    payload = mounted(example_tool, 0.3, -1.0, 2.0)
    tool = replace(example_tool, sensor_angle=0.3, sensor_sign=-1.0)
    R = attitude(0.3, 2.8, -0.7)
    contact = payload.contact(reading(payload, R, np.zeros(3), tool), R)
    assert np.allclose(contact, 0.0, atol=EXACT)


def test_a_hanging_foot_has_the_reading_of_the_worked_example(example_tool):
    payload = mounted(example_tool)
    assert np.allclose(payload.weight(FOOT_DOWN)[:3], [0, 0, 4.4145], atol=EXACT)
    ground = np.array([0.0, 0.0, 2.943])
    loaded = reading(payload, FOOT_DOWN, ground, example_tool)
    assert np.allclose(loaded[:3], [0.0, 0.0, 1.4715], atol=EXACT)


@pytest.mark.parametrize("tilt_deg", [10.0, 15.0, 60.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("psi", [0.0, 0.8])
def test_a_tare_at_one_angle_holds_at_another(example_tool, tilt_deg, sign, psi):
    tool = replace(example_tool, sensor_angle=psi, sensor_sign=sign)
    truth = mounted(tool, psi, sign, bias=1.7)
    in_air = reading(truth, FOOT_DOWN, np.zeros(3), tool)
    payload = mounted(tool, psi, sign).tared(in_air, FOOT_DOWN)
    tilted = rotation(1, np.deg2rad(tilt_deg)) @ FOOT_DOWN
    left = payload.contact(reading(truth, tilted, np.zeros(3), tool), tilted)
    assert np.allclose(left, 0.0, atol=EXACT)
    assert np.allclose(payload.bias, truth.bias, atol=EXACT)


@pytest.mark.parametrize(("tilt_deg", "newton"), [(10.0, 0.77), (15.0, 1.15)])
def test_a_tare_without_weight_compensation_leaves_an_error(
    example_tool, tilt_deg, newton
):
    payload = mounted(example_tool)
    tilted = rotation(1, np.deg2rad(tilt_deg)) @ FOOT_DOWN
    left = payload.weight(tilted) - payload.weight(FOOT_DOWN)
    assert np.linalg.norm(left[:3]) == pytest.approx(newton, abs=0.01)


def test_taring_changes_only_the_bias(example_tool):
    payload = mounted(example_tool, 0.2, -1.0)
    tared = payload.tared(np.arange(6.0), FOOT_DOWN)
    assert replace(tared, bias=payload.bias) == payload
    assert not np.array_equal(tared.bias, payload.bias)


def test_a_recording_is_computed_like_its_single_samples(example_tool):
    rng = np.random.default_rng(0)
    payload = mounted(example_tool, 0.4, -1.0, 0.3)
    raw = rng.normal(size=(20, 6))
    R = np.array([attitude(*rng.uniform(-3, 3, 3)) for _ in range(20)])
    contact = payload.contact(raw, R)
    force = payload.to_base(contact, R)
    assert (contact.shape, force.shape) == ((20, 6), (20, 3))
    for i in range(20):
        alone = payload.contact(raw[i], R[i])
        assert np.allclose(contact[i], alone, atol=EXACT)
        assert np.allclose(force[i], payload.to_base(alone, R[i]), atol=EXACT)


@given(a=st.tuples(newtons, newtons, newtons), b=st.tuples(newtons, newtons, newtons))
def test_the_cross_matrix_is_the_cross_product(a, b):
    a, b = np.array(a), np.array(b)
    assert np.allclose(cross_matrix(a) @ b, np.cross(a, b), atol=EXACT)


def test_the_payload_of_a_tool_is_its_foot_in_the_sensor_frame(example_tool):
    payload = payload_of(replace(example_tool, sensor_angle=np.pi / 2))
    assert payload.mass == example_tool.foot.mass
    assert np.allclose(payload.com, [0.0, -0.01, 0.05], atol=EXACT)
    assert np.allclose(payload.rotation, rotation(2, np.pi / 2), atol=EXACT)
    assert not payload.bias.any()


def terrain(incline_deg, heading=0.0, start=(0.9, 0.1, -0.3)):
    return TerrainFrame(np.deg2rad(incline_deg), heading, start, 0.45)


@pytest.mark.parametrize("incline_deg", INCLINES)
def test_the_axes_of_a_terrain_are_those_of_the_model(incline_deg):
    a = np.deg2rad(incline_deg)
    x, y, z = terrain(incline_deg).axes()
    assert np.allclose(x, [-np.cos(a), 0.0, -np.sin(a)], atol=EXACT)
    assert np.allclose(y, [0.0, -1.0, 0.0], atol=EXACT)
    assert np.allclose(z, [-np.sin(a), 0.0, np.cos(a)], atol=EXACT)


@pytest.mark.parametrize("incline_deg", INCLINES)
@pytest.mark.parametrize("heading", [0.0, 0.6, -2.0])
def test_axes_are_right_handed_and_turned_by_the_heading(incline_deg, heading):
    axes = terrain(incline_deg, heading).axes()
    assert np.allclose(axes @ axes.T, np.eye(3), atol=EXACT)
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=EXACT)
    straight = terrain(incline_deg).axes()
    assert np.allclose(axes, straight @ rotation(2, heading).T, atol=EXACT)


@pytest.mark.parametrize("incline_deg", INCLINES)
def test_from_the_other_end_the_plane_is_crossed_in_reverse(incline_deg):
    frame = terrain(incline_deg, heading=0.6)
    back = frame.from_other_end()
    turned = np.diag([-1.0, -1.0, 1.0])
    assert np.allclose(back.axes(), turned @ frame.axes(), atol=EXACT)
    there = np.array(back.start)
    assert frame.displacement(there) == pytest.approx(frame.travel, abs=EXACT)
    assert np.allclose(back.from_other_end().start, frame.start, atol=EXACT)


@pytest.mark.parametrize("incline_deg", [10.0, 15.0])
def test_a_trial_goes_downhill_and_toward_the_base(incline_deg):
    frame = terrain(incline_deg, heading=0.7)
    x = frame.axes()[0]
    away = np.array([np.cos(0.7), np.sin(0.7)])
    assert x[2] < 0.0
    assert x[:2] @ away < 0.0


@pytest.mark.parametrize("incline_deg", INCLINES)
@pytest.mark.parametrize("heading", [0.0, 0.6])
def test_displacement_grows_from_the_start_and_height_above_the_plane(
    incline_deg, heading
):
    frame = terrain(incline_deg, heading)
    x, y, z = frame.axes()
    point = np.array(frame.start) + 0.3 * x - 0.05 * y + 0.02 * z
    assert frame.displacement(point) == pytest.approx(0.3, abs=EXACT)
    assert frame.height(point) == pytest.approx(0.02, abs=EXACT)
    path = np.array([frame.start, point])
    assert np.allclose(frame.displacement(path), [0.0, 0.3], atol=EXACT)
    assert np.allclose(frame.height(path), [0.0, 0.02], atol=EXACT)


@pytest.mark.parametrize("incline_deg", INCLINES)
@pytest.mark.parametrize("heading", [0.0, 0.6])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_ordinary_slip_has_positive_velocity_and_forces(
    example_tool, incline_deg, heading, sign
):
    """From the raw reading to traction: the foot slides down the plate."""
    frame = terrain(incline_deg, heading)
    x, _, z = frame.axes()
    tool = replace(example_tool, sensor_angle=0.4, sensor_sign=sign)
    payload = mounted(tool, 0.4, sign, bias=0.5)
    R = rotation(2, heading) @ FOOT_DOWN
    force = 8.0 * z - 5.0 * x  # pressed on the plate, dragged back by it
    contact = payload.contact(reading(payload, R, force, tool), R)
    found = traction(frame.axes(), 0.03 * x, payload.to_base(contact, R))
    assert np.allclose(found, [0.03, 5.0, 8.0], atol=EXACT)


def test_bounce_back_is_a_negative_velocity():
    axes = terrain(10.0).axes()
    assert traction(axes, -0.02 * axes[0], np.zeros(3))[0] == pytest.approx(-0.02)


def test_sideways_motion_and_force_are_ignored():
    axes = terrain(15.0, 0.3).axes()
    found = traction(axes, axes[1] + axes[2], 7.0 * axes[1])
    assert np.allclose(found, 0.0, atol=EXACT)


def test_traction_of_a_recording_is_traction_of_its_samples():
    rng = np.random.default_rng(1)
    axes = terrain(10.0, 0.2).axes()
    velocity, force = rng.normal(size=(2, 30, 3))
    found = traction(axes, velocity, force)
    assert found.shape == (30, 3)
    for i in range(30):
        assert np.allclose(found[i], traction(axes, velocity[i], force[i]), atol=EXACT)


def test_a_massless_payload_leaves_the_reading_unchanged(example_tool):
    payload = Payload(0.0, np.zeros(3), np.eye(3), 1.0, np.zeros(6))
    raw = np.arange(6.0)
    assert np.array_equal(payload.contact(raw, FOOT_DOWN), raw)
