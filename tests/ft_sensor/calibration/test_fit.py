import numpy as np
import pytest

from acquisition.errors import SettingsError
from ft_sensor.calibration.fit import check_residual, fit_sensor
from ft_sensor.payload import Payload

MASS, COM = 0.45, np.array([0.012, -0.004, 0.055])
BIAS = np.array([12.0, -40.0, 3.0, 0.2, -0.4, 0.05])


def orientations(count, seed=4):
    rng = np.random.default_rng(seed)
    q, r = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    q *= np.sign(np.einsum("nii->ni", r))[:, None, :]
    q[np.linalg.det(q) < 0] *= -1.0
    return q


def payload(angle_deg=0.0, sign=1.0, mass=MASS):
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Payload(mass, COM, rotation, sign, BIAS)


def readings(held, rotations, noise=0.0, seed=1):
    """Return the readings of the sensor, by the model that the loop uses."""
    rng = np.random.default_rng(seed)
    clean = held.bias + held.sign * held.weight(rotations)
    return clean + noise * rng.normal(size=clean.shape) * [1, 1, 1, 0.03, 0.03, 0.03]


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, -135.0, 179.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_payload_bias_mounting_and_sign_are_recovered_exactly(angle_deg, sign):
    held, rotations = payload(angle_deg, sign), orientations(8)
    fit = fit_sensor(rotations, readings(held, rotations))
    assert fit.mass == pytest.approx(MASS, abs=1e-6)
    assert fit.com == pytest.approx(COM, abs=1e-5)
    assert fit.bias == pytest.approx(BIAS, abs=1e-4)
    assert np.degrees(fit.angle) == pytest.approx(angle_deg, abs=1e-3)
    assert fit.sign == sign
    assert fit.residual < 1e-4


def test_noise_leaves_the_required_accuracy():
    # 0.08 N white noise, averaged over 1600 samples, and a quantum of 0.05 N
    held, rotations = payload(20.0), orientations(12)
    shown = np.round(readings(held, rotations, noise=0.002) / 0.002) * 0.002
    fit = fit_sensor(rotations, shown)
    assert fit.mass == pytest.approx(MASS, abs=0.005)
    assert fit.com == pytest.approx(COM, abs=0.002)
    assert fit.bias[:3] == pytest.approx(BIAS[:3], abs=0.05)
    assert np.degrees(fit.angle) == pytest.approx(20.0, abs=0.5)


def test_drift_shows_in_the_residual_and_is_refused():
    held, rotations = payload(), orientations(12)
    shown = readings(held, rotations)
    shown[:, :3] += np.linspace(-1.0, 1.0, 12)[:, None]
    fit = fit_sensor(rotations, shown)
    assert fit.residual > 0.3
    with pytest.raises(SettingsError, match=r"N rms unexplained \(limit 0.3\)"):
        check_residual(fit, is_forced=False)
    check_residual(fit, is_forced=True)


def test_a_clean_fit_is_accepted():
    held, rotations = payload(), orientations(6)
    fit = fit_sensor(rotations, readings(held, rotations))
    check_residual(fit, is_forced=False)
    assert fit.torque_residual < 1e-6


def test_too_few_orientations_are_refused():
    held, rotations = payload(), orientations(5)
    with pytest.raises(SettingsError, match="5 orientations were measured, 6"):
        fit_sensor(rotations, readings(held, rotations))


def test_similar_orientations_are_refused():
    rotations = np.repeat(orientations(1), 8, axis=0)
    with pytest.raises(SettingsError, match="too similar"):
        fit_sensor(rotations, readings(payload(), rotations))


def test_on_an_incline_a_calibration_holds_where_a_tare_does_not():
    """Turning 0.45 kg by 10 degrees shifts its weight by 0.77 N."""
    held = payload()
    a = np.radians(10.0)
    tilt = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    down = np.diag([1.0, -1.0, -1.0])
    turned = tilt @ down
    buried = readings(held, down)
    apparent = readings(held, turned) - buried
    assert np.linalg.norm(apparent[:3]) == pytest.approx(0.77, abs=0.01)
    corrected = held.contact(readings(held, turned), turned)
    assert np.linalg.norm(corrected[:3]) < 1e-9


def test_an_inverted_weight_is_refused_if_the_mounting_is_stated():
    held, rotations = payload(sign=-1.0), orientations(12)
    with pytest.raises(SettingsError, match=r"its sign is not \+1"):
        fit_sensor(rotations, readings(held, rotations), mounting=(0.0, 1.0))


def test_readings_without_weight_are_refused():
    rotations = orientations(12)
    shown = np.tile(BIAS, (12, 1))
    shown[:, 2] += 1e-9 * rotations[:, 2, 2]
    with pytest.raises(SettingsError, match="do not change with the orientation"):
        fit_sensor(rotations, shown, mounting=(0.0, 1.0))
