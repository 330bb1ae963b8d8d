"""The drag of a trial is computed from the friction calibration recorded with it."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.data.load import load_trial
from tests.analysis.data.test_load import as_left, summarised, write
from tests.wam.model.test_friction import example
from wam.calibration.friction_file import FrictionCalibration, friction_to_toml
from wam.calibration.friction_fit import FrictionFit
from wam.model.constants import load_constants

CONSTANTS = load_constants()


def text(scale=1.0, *, is_simulated=True):
    shown = replace(example(), asymmetry=np.zeros(7))
    shown = replace(shown, coulomb=scale * shown.coulomb)
    fit = FrictionFit(shown, np.zeros(7), np.zeros(7), np.full(7, 0.02), (100,) * 7)
    kept = FrictionCalibration(
        fit, "tread", "cad", "2027-01-15T08:00:00Z", is_simulated
    )
    return friction_to_toml(kept, CONSTANTS)


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    path = tmp_path_factory.mktemp("trial") / "T01.mcap"
    write(path, **{"friction.toml": text()})
    return load_trial(path)


def health(trial, share="0.0", **changes):
    """Return the health of a simulated trial that moved joint 2."""
    speeds = np.zeros((trial.t.size, 7))
    speeds[:, 1] = 0.1
    left = as_left(trial, velocity=speeds)
    left.metadata["trial"] |= {"simulated": "true", "friction_compensation": share}
    (row,) = summarised([replace(left, **changes)])
    return row


def test_a_trial_contains_the_calibration_recorded_with_it(trial):
    assert trial.friction_text == text()


def test_drag_follows_the_calibration(trial):
    power = 0.1 * np.abs(CONSTANTS.j2mp[:, 1]) @ example().coulomb
    expected = np.median(power / np.abs(trial.traction[:, 0]))
    assert health(trial).drag == pytest.approx(expected)


def test_compensated_friction_is_not_drag(trial):
    none, most = health(trial), health(trial, share="0.8")
    assert most.drag == pytest.approx(0.2 * none.drag)


@pytest.mark.parametrize("recorded", ["", "nothing = 1", text(is_simulated=False)])
def test_without_a_calibration_of_this_arm_drag_is_that_of_the_model(trial, recorded):
    expected = np.median(0.1 * CONSTANTS.coulomb[1] / np.abs(trial.traction[:, 0]))
    assert health(trial, friction_text=recorded).drag == pytest.approx(expected)
