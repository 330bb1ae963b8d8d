import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import DeviceFaultError, SettingsError
from wam.driver.puck_properties import shipped_table
from wam.driver.safety_module import SafetyLimits
from wam.driver.settings import ArmSettings
from wam.driver.transmission import (
    HOST_TORQUE_LIMITS,
    Transmission,
    keep_gravity,
)
from wam.model.constants import load_constants

VECTORS = json.loads(
    (Path(__file__).parents[2] / "data" / "wam7_vectors.json").read_text()
)["vectors"]
CTS = (4096,) * 7
IPNM = (2700, 2700, 2700, 2700, 6500, 6500, 17474)
TAU = np.array([1.0, -15.0, 2.0, 5.0, 0.3, -0.2, 0.05])
ZERO = np.zeros(7)

J2MP = np.array(
    [
        [-42.0, 0, 0, 0, 0, 0, 0],
        [0, 28.25, -16.8155, 0, 0, 0, 0],
        [0, -28.25, -16.8155, 0, 0, 0, 0],
        [0, 0, 0, -18.0, 0, 0, 0],
        [0, 0, 0, 0, 9.7, -9.7, 0],
        [0, 0, 0, 0, 9.7, 9.7, 0],
        [0, 0, 0, 0, 0, 0, -14.93],
    ]
)


@pytest.fixture(scope="module")
def wam():
    return Transmission(J2MP, CTS, IPNM)


def by_name(vector):
    return vector["name"]


@pytest.mark.parametrize("vector", VECTORS, ids=by_name)
def test_counts_agree_with_the_reference_vectors(wam, vector):
    counts = wam.counts(np.array(vector["q"]))
    for found, expected in zip(counts, vector["motor_counts_floor"], strict=True):
        assert expected is None or found == expected


@pytest.mark.parametrize("vector", VECTORS, ids=by_name)
def test_joints_are_recovered_from_exact_counts(wam, vector):
    q = wam.joints(vector["motor_counts"])
    # Far below the 27 microrad of one count.
    assert q == pytest.approx(vector["q"], abs=1e-9)


@pytest.mark.parametrize("vector", VECTORS, ids=by_name)
def test_gravity_in_puck_units_agrees_with_the_reference_vectors(wam, vector):
    units = wam.exact_units(np.array(vector["gravity"]))
    assert units == pytest.approx(vector["gravity_puck_units"], abs=1e-9)


def test_flooring_counts_costs_less_than_one_count_in_the_joints(wam):
    pose_a = next(v for v in VECTORS if v["name"] == "generic_a")
    q = wam.joints(wam.counts(np.array(pose_a["q"])))
    assert abs(q - np.array(pose_a["q"])).max() < 1.2e-4


def test_golden_torque_floors_to_the_known_units(wam):
    units = np.floor(wam.exact_units(TAU)).astype(int).tolist()
    assert units == [-65, -878, 556, -750, 167, 33, -59]
    back = wam.tau(units)
    assert back == pytest.approx(
        (1.011, -15.004, 2.005, 5.000, 0.298, -0.200, 0.0504), abs=6e-4
    )  # printed digits


def test_torques_are_rounded_to_the_nearest_unit(wam):
    command = wam.command(TAU, ZERO)
    error = np.array(command.units) - wam.exact_units(TAU)
    assert abs(error).max() <= 0.5
    assert command.units[0] == -64  # -64.28, which the wire would floor to -65
    assert not command.is_clipped


def test_command_returns_the_torque_of_whole_units(wam):
    command = wam.command(TAU, ZERO)
    assert command.tau == pytest.approx(wam.tau(command.units), abs=1e-15)
    assert not np.array_equal(command.tau, TAU)


def test_clipping_keeps_gravity_and_scales_the_rest(wam):
    gravity = np.array([0.0, -14.0, 3.0, 5.0, 0.2, -0.1, 0.0])
    wanted = gravity + np.array([0.0, 200.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    command = wam.command(wanted, gravity)
    assert command.is_clipped
    assert max(abs(u) for u in command.units) in HOST_TORQUE_LIMITS
    # Half a unit of every motor, seen at the joints.
    unit = np.abs(wam.j2mp.T / np.array(IPNM)).sum(axis=1)
    beyond = np.abs(command.tau - gravity) > unit / 2
    assert beyond.tolist() == [False, True, False, False, False, False, False]


def test_gravity_beyond_a_limit_leaves_no_other_torque():
    assert keep_gravity([12.0, 3.0], [11.0, 1.0], [10.0, 10.0]) == [10.0, 1.0]


def test_torques_within_their_limits_are_unchanged():
    assert keep_gravity([5.0, -3.0], [4.0, 1.0], [10.0, 10.0]) == [5.0, -3.0]


@given(
    st.lists(st.floats(-300, 300), min_size=7, max_size=7),
    st.lists(st.floats(-20, 20), min_size=7, max_size=7),
)
def test_no_command_exceeds_a_limit(tau, gravity):
    wam = Transmission(J2MP, CTS, IPNM)
    units = wam.command(np.array(tau), np.array(gravity)).units
    assert all(
        abs(u) <= limit for u, limit in zip(units, HOST_TORQUE_LIMITS, strict=True)
    )


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_torque_that_is_not_a_number_is_refused(wam, bad):
    with pytest.raises(DeviceFaultError, match="not numbers"):
        wam.command(np.full(7, bad), ZERO)


def test_power_is_the_same_on_both_sides(wam):
    qd = np.array([0.3, -0.2, 0.5, 0.1, -0.4, 0.2, 0.7])
    motor_rates = wam.j2mp @ qd
    motor_torques = wam.exact_units(TAU) / np.array(IPNM)
    assert motor_rates @ motor_torques == pytest.approx(qd @ TAU, rel=1e-12)


def test_the_driver_has_the_matrix_of_the_arm_model():
    assert (ArmSettings().j2mp == load_constants().j2mp).all()
    assert load_constants().j2mp == pytest.approx(J2MP, abs=5e-5)


@pytest.mark.parametrize(
    ("j2mp", "cts"),
    [(np.eye(6), CTS), (np.zeros((7, 7)), CTS), (J2MP, CTS[:6]), (J2MP, (0,) * 7)],
)
def test_invalid_transmission_constants_are_refused(j2mp, cts):
    with pytest.raises(SettingsError):
        Transmission(j2mp, cts, IPNM)


def test_host_torque_limits_are_those_of_the_cable_and_below_the_modules_warning():
    cable = np.array(shipped_table().MT.values)
    warning = 0.9 * SafetyLimits().words()["TL1"]
    assert tuple(np.minimum(cable, int(warning)).tolist()) == HOST_TORQUE_LIMITS


def test_a_matrix_changed_afterwards_does_not_change_the_transmission():
    given = J2MP.copy()
    wam = Transmission(given, CTS, IPNM)
    given[:] = np.eye(7)
    assert (wam.j2mp == J2MP).all()


@pytest.mark.parametrize("least", [1, 2])
def test_the_smallest_valid_constants_are_accepted(least):
    wam = Transmission(J2MP, (least, *CTS[1:]), (least, *IPNM[1:]))
    assert wam.exact_units(TAU)[0] == pytest.approx(-least * TAU[0] / 42.0)
    with pytest.raises(SettingsError):
        Transmission(J2MP, CTS, (0, *IPNM[1:]))


def test_a_barely_invertible_transmission_is_accepted():
    assert Transmission(np.eye(7), CTS, IPNM).joints([4096] + [0] * 6)[
        0
    ] == pytest.approx(2 * np.pi)
    with pytest.raises(SettingsError, match="inverted"):
        Transmission(0.99 * np.eye(7), CTS, IPNM)


@pytest.mark.parametrize("motor", [0, 4, 6])
def test_every_motor_has_its_own_limit_of_torque(motor):
    """A torque far beyond all limits is clipped to the limit of its motor."""
    wam = Transmission(np.eye(7), CTS, IPNM)
    tau = np.zeros(7)
    tau[motor] = 1e3
    assert wam.command(tau, ZERO).units[motor] == HOST_TORQUE_LIMITS[motor]
    assert wam.command(-tau, ZERO).units[motor] == -HOST_TORQUE_LIMITS[motor]
