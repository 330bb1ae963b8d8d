"""Zero errors of joints are identified from holding torques where observable."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from wam.calibration.free_space import FreeSpace
from wam.calibration.poses import choose_poses
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants
from wam.model.moments import (
    LARGEST_ZERO_ERROR,
    ZeroErrors,
    check_zeros,
    fit_moments,
    zero_errors,
)

CONSTANTS = load_constants()
# Residual of a sound real arm [N m], rms.
NOISE = 0.1
DEVIATIONS = {2: 0.6, 3: 1.2, 4: 5.0, 5: 5.0}  # degrees at that noise, 12 poses


@pytest.fixture(scope="module")
def model(example_tool):
    return ArmModel(CONSTANTS, example_tool)


@pytest.fixture(scope="module")
def poses(model):
    return np.array(choose_poses(model, 12, FreeSpace(0.33)))


def measured(model, poses, joint=2, degrees=0.0, noise=0.0, seed=1):
    """Return the zero errors identified for an arm with one wrongly zeroed joint."""
    true = poses.copy()
    true[:, joint - 1] += np.radians(degrees)
    tau = np.array([model.gravity(q) for q in true])
    tau += noise * np.random.default_rng(seed).normal(size=tau.shape)
    return zero_errors(CONSTANTS, poses, fit_moments(CONSTANTS, poses, tau))


@pytest.mark.parametrize("degrees", [-5.0, 1.0, 5.0])
@pytest.mark.parametrize("joint", [2, 3, 4, 5])
def test_a_wrong_zero_is_recovered_with_its_sign(model, poses, joint, degrees):
    found = measured(model, poses, joint, degrees)
    expected = [degrees if other == joint else 0.0 for other in found.joints]
    assert np.degrees(found.errors) == pytest.approx(
        expected, abs=0.8
    )  # to first order


@pytest.mark.parametrize("joint", [1, 6, 7])
def test_a_wrong_zero_of_joints_1_6_and_7_is_not_observable(model, poses, joint):
    found = measured(model, poses, joint, 5.0)
    assert np.abs(np.degrees(found.errors)).max() < 0.3
    check_zeros(found)


def test_the_stated_uncertainty_of_a_zero_is_correct(model, poses):
    fits = [measured(model, poses, noise=NOISE, seed=seed) for seed in range(40)]
    spread = np.degrees(np.std([found.errors for found in fits], axis=0))
    stated = np.degrees(np.mean([found.deviations for found in fits], axis=0))
    assert stated == pytest.approx(spread, rel=0.35)
    assert (stated < list(DEVIATIONS.values())).all()


def test_a_sound_arm_is_not_refused(model, poses):
    for seed in range(20):
        check_zeros(measured(model, poses, noise=2.0 * NOISE, seed=seed))


@pytest.mark.parametrize("joint", [2, 3])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_large_zero_error_is_refused_with_its_joint(model, poses, joint, sign):
    found = measured(model, poses, joint, 2.0 * sign * LARGEST_ZERO_ERROR, NOISE)
    with pytest.raises(SettingsError, match=f"Joint {joint} seems") as refused:
        check_zeros(found)
    assert f"{'+' if sign > 0 else '-'}" in refused.value.message
    assert f"limit {LARGEST_ZERO_ERROR:g}" in refused.value.message


@pytest.mark.parametrize(
    ("error", "deviation", "is_refused"),
    [
        (0.99 * LARGEST_ZERO_ERROR, 0.1, False),
        (1.01 * LARGEST_ZERO_ERROR, 0.1, True),
        (-1.01 * LARGEST_ZERO_ERROR, 0.1, True),
        (2.0 * LARGEST_ZERO_ERROR, LARGEST_ZERO_ERROR / 2.0 / 1.01, True),
        (2.0 * LARGEST_ZERO_ERROR, LARGEST_ZERO_ERROR / 2.0 / 0.99, False),
    ],
)
def test_a_refused_zero_error_is_large_and_significant(error, deviation, is_refused):
    """Significant is an error of more than four standard deviations."""
    errors = np.radians([0.0, error, 0.0, 0.0])
    found = ZeroErrors((2, 3, 4, 5), errors, np.full(4, np.radians(deviation)))
    if is_refused:
        with pytest.raises(SettingsError, match="Joint 3"):
            check_zeros(found)
    else:
        check_zeros(found)
