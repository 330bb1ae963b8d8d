import numpy as np
import pytest

from experiments.run.tare import known_bias, residual_force
from ft_sensor.calibration.fit import SensorFit
from ft_sensor.calibration.sensor_file import SensorCalibration, sensor_to_toml
from ft_sensor.payload import Payload

BIAS = np.array([0.5, -1.0, 2.0, 0.01, 0.02, 0.03])


def calibration(foot):
    fit = SensorFit(0.45, np.zeros(3), BIAS, 0.0, 1.0, 0.01, 0.001)
    found = SensorCalibration(
        fit, foot, 0.0, "2027-01-01T00:00:00Z", False, np.eye(3)[None], BIAS[None]
    )
    return {"calibration:ft_sensor.toml": sensor_to_toml(found)}


def payload(mass):
    return Payload(mass, np.zeros(3), np.eye(3), 1.0, np.zeros(6))


def test_a_calibrated_sensor_is_known_with_its_foot_only():
    known = known_bias(calibration("tread"), "tread", is_simulated=False)
    np.testing.assert_array_equal(known, BIAS)
    assert known_bias(calibration("tread"), "bare", is_simulated=False) is None


def test_a_real_sensor_that_nobody_calibrated_is_not_known():
    assert known_bias({}, "tread", is_simulated=False) is None
    assert known_bias({"rig": "bias = 1"}, "tread", is_simulated=False) is None


def test_a_simulated_sensor_has_no_bias_of_its_own():
    np.testing.assert_array_equal(known_bias({}, "tread", is_simulated=True), 0.0)


def test_a_wrong_mass_of_the_foot_shows_as_its_weight():
    """What the tare takes away beside the sensor's own bias."""
    truth, believed = payload(0.45), payload(0.40)
    reading = BIAS + truth.weight(np.eye(3))
    right = truth.tared(reading, np.eye(3))
    wrong = believed.tared(reading, np.eye(3))
    assert residual_force(right, BIAS) == pytest.approx(0.0, abs=1e-12)
    assert residual_force(wrong, BIAS) == pytest.approx(0.05 * 9.81, rel=1e-3)
