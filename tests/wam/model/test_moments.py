import dataclasses

import numpy as np
import pytest

from acquisition.errors import SettingsError
from wam.model.arm_model import ArmModel
from wam.model.constants import Body, load_constants
from wam.model.gravity import gravity_model
from wam.model.moments import (
    MomentFit,
    check_fit,
    fit_moments,
    gravity_torque,
    moments_of_links,
)

CONSTANTS = load_constants()


def random_poses(count, seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(CONSTANTS.q_lower, CONSTANTS.q_upper, (count, 7))


def torques(constants, poses):
    model = ArmModel(constants)
    return np.array([model.gravity(q) for q in poses])


def test_shipped_moments_give_the_reference_torques(arm_vectors):
    for vector in arm_vectors["vectors"]:
        tau = gravity_torque(CONSTANTS, CONSTANTS.mus, np.array(vector["q"]), 9.805)
        # the vectors are printed to double precision
        assert tau == pytest.approx(vector["gravity_mus_g9805"], abs=1e-9)


def test_masses_and_moments_give_equal_torques():
    mus = moments_of_links(CONSTANTS)
    model = ArmModel(CONSTANTS)
    for q in random_poses(20, seed=1):
        assert gravity_torque(CONSTANTS, mus, q) == pytest.approx(
            model.gravity(q), abs=1e-12
        )


def test_a_body_on_the_plate_adds_its_moments(example_tool):
    mus = moments_of_links(CONSTANTS, (example_tool.sensor, example_tool.foot))
    model = ArmModel(CONSTANTS, example_tool)
    for q in random_poses(20, seed=2):
        assert gravity_torque(CONSTANTS, mus, q) == pytest.approx(
            model.gravity(q), abs=1e-12
        )


def test_a_virtual_mass_is_a_body_of_negative_mass(example_tool):
    mass = 0.3
    pull = Body(-mass, example_tool.foot.com, np.zeros((3, 3)))
    bare = moments_of_links(CONSTANTS)
    with_pull = moments_of_links(CONSTANTS, (pull,))
    model = ArmModel(CONSTANTS, example_tool)
    for q in random_poses(10, seed=3):
        added = gravity_torque(CONSTANTS, with_pull - bare, q)
        assert added == pytest.approx(model.weight_torque(q, mass), abs=1e-12)


def perturbed():
    rng = np.random.default_rng(4)
    links = tuple(
        dataclasses.replace(
            link,
            mass=link.mass * float(rng.uniform(0.8, 1.2)),
            com=link.com + rng.normal(0.0, 0.01, 3),
        )
        for link in CONSTANTS.links
    )
    return dataclasses.replace(CONSTANTS, links=links)


def test_calibration_recovers_the_torques_of_a_perturbed_arm():
    arm = perturbed()
    poses = CONSTANTS.calibration_poses
    rng = np.random.default_rng(5)
    measured = torques(arm, poses) + rng.normal(0.0, 0.02, (len(poses), 7))
    fit = fit_moments(CONSTANTS, poses, measured)
    check_fit(fit)
    assert fit.rank == 12
    assert fit.condition == pytest.approx(5.78, abs=0.01)  # of these nine poses
    assert 0.0 < fit.residual < 0.03
    others = random_poses(50, seed=6)
    found = np.array([gravity_torque(CONSTANTS, fit.mus, q) for q in others])
    error = np.sqrt(np.mean((found - torques(arm, others)) ** 2))
    assert error < 0.1
    untouched = np.sqrt(np.mean((torques(CONSTANTS, others) - found) ** 2))
    assert untouched > 0.3  # the perturbation is large enough to need a calibration


def test_too_few_poses_are_refused():
    poses = CONSTANTS.calibration_poses[:2]
    fit = fit_moments(CONSTANTS, poses, torques(CONSTANTS, poses))
    with pytest.raises(SettingsError, match="of 12 directions"):
        check_fit(fit)


def test_poorly_conditioned_poses_are_refused():
    fit = MomentFit(CONSTANTS.mus, 12, 30.1, np.zeros((4, 7)))
    with pytest.raises(SettingsError, match=r"condition 30 \(limit 30\)"):
        check_fit(fit)
    check_fit(dataclasses.replace(fit, condition=29.9))


def test_torques_that_gravity_cannot_explain_are_refused():
    poses = CONSTANTS.calibration_poses
    spoiled = torques(CONSTANTS, poses)
    spoiled[::2, 1] += 6.0
    with pytest.raises(SettingsError, match="unexplained"):
        check_fit(fit_moments(CONSTANTS, poses, spoiled))


def test_the_worst_joint_and_pose_are_reported():
    residuals = np.full((3, 7), 0.6)
    residuals[1, 4] = -2.0
    fit = MomentFit(CONSTANTS.mus, 12, 6.0, residuals)
    with pytest.raises(SettingsError, match="most at joint 5 in pose 2"):
        check_fit(fit)


def test_a_residual_that_is_not_a_number_is_refused():
    fit = MomentFit(CONSTANTS.mus, 12, 6.0, np.full((3, 7), np.nan))
    with pytest.raises(SettingsError, match="unexplained"):
        check_fit(fit)


def test_poses_and_torques_of_different_shapes_are_refused():
    with pytest.raises(ValueError, match=r"\(n, 7\)"):
        fit_moments(CONSTANTS, np.zeros((3, 7)), np.zeros((2, 7)))


def test_a_model_with_the_shipped_moments_gives_their_torques(example_tool):
    model = gravity_model(CONSTANTS, example_tool, CONSTANTS.mus)
    bare = ArmModel(CONSTANTS)
    loaded = ArmModel(CONSTANTS, example_tool)
    for q in random_poses(10, seed=7):
        tool_alone = loaded.gravity(q) - bare.gravity(q)
        expected = gravity_torque(CONSTANTS, CONSTANTS.mus, q) + tool_alone
        assert model.gravity(q) == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("mass", [0.45, 0.70])
def test_moments_fitted_with_one_foot_apply_to_another(example_tool, mass):
    foot = example_tool.foot
    other = dataclasses.replace(foot, mass=mass, com=foot.com + 0.02)
    session = dataclasses.replace(example_tool, foot=other)
    mus = moments_of_links(CONSTANTS, (example_tool.sensor, foot))
    model = gravity_model(CONSTANTS, session, mus, example_tool)
    truth = ArmModel(CONSTANTS, session)
    for q in random_poses(10, seed=8):
        assert model.gravity(q) == pytest.approx(truth.gravity(q), abs=1e-11)
        # the virtual mass pulls at the centre of the mounted foot
        assert model.weight_torque(q, 0.3) == pytest.approx(
            truth.weight_torque(q, 0.3), abs=1e-12
        )
