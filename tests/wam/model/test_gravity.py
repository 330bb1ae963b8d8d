import numpy as np
import pytest

from wam.model.constants import GRAVITY
from wam.model.gravity import MAX_VIRTUAL_MASS, VirtualMass, compensation

S = 1_000_000_000
DOWN = np.array([0, 0.9, 0, 1.6, 0, np.pi - 2.5, 0])
J2, J4, J6 = 1, 3, 5


def test_without_a_virtual_mass_the_whole_weight_is_compensated(foot_model):
    tau = compensation(foot_model, DOWN, 0.0)
    expected = [-26.532280181, -5.109250202, 0.044017118]
    assert tau[[J2, J4, J6]] == pytest.approx(expected, abs=1e-9)


def test_a_virtual_mass_reduces_the_holding_torque(foot_model):
    added = compensation(foot_model, DOWN, 0.3) - compensation(foot_model, DOWN, 0.0)
    expected = [1.955315529, 0.605060511, -0.029430000]
    assert added[[J2, J4, J6]] == pytest.approx(expected, abs=1e-9)


def test_the_commanded_torque_is_the_sum_of_both(foot_model):
    tau = compensation(foot_model, DOWN, 0.3)
    expected = [-24.576964652, -4.504189691, 0.014587118]
    assert tau[[J2, J4, J6]] == pytest.approx(expected, abs=1e-9)


def test_every_pose_agrees_with_the_reference_vectors(foot_model, arm_vectors):
    for vector in arm_vectors["vectors"]:
        tau = compensation(foot_model, np.array(vector["q"]), 0.3)
        assert np.allclose(tau, vector["augmented_gravity"], rtol=0.0, atol=1e-9)


def test_the_ground_supports_the_virtual_weight(foot_model):
    """Below the centre of mass, the ground's force balances the added torque."""
    ground = np.array([0.0, 0.0, 0.3 * GRAVITY])
    from_ground = foot_model.sole_jacobian(DOWN)[:3].T @ ground
    added = foot_model.weight_torque(DOWN, 0.3)
    assert np.allclose(from_ground + added, 0.0, atol=1e-12)


def test_the_foot_sinks_without_a_ground(foot_model):
    tau = compensation(foot_model, DOWN, 0.3) - foot_model.gravity(DOWN)
    qdd = np.linalg.solve(foot_model.mass_matrix(DOWN), tau)
    # the linear Jacobian of the centre of mass, by differences of its position
    step = 1e-6
    J_z = [
        foot_model.foot_com_position(DOWN + d)[2]
        - foot_model.foot_com_position(DOWN - d)[2]
        for d in step * np.eye(7)
    ]
    acceleration = np.array(J_z) / (2 * step) @ qdd
    assert acceleration == pytest.approx(-1.005, abs=0.001)  # weight without inertia


def test_the_virtual_mass_is_ramped():
    mass = VirtualMass()
    mass.aim(0.4, 10 * S)
    found = [mass.at(10 * S + int(t * S)) for t in (-1.0, 0.0, 0.5, 1.0, 2.0, 9.0)]
    assert found == pytest.approx([0.0, 0.0, 0.1, 0.2, 0.4, 0.4], abs=1e-12)


def test_a_new_target_mass_ramps_from_the_present_mass():
    mass = VirtualMass()
    mass.aim(0.4, 0)
    mass.aim(0.0, 1 * S)
    found = [mass.at(int(t * S)) for t in (1.0, 2.0, 3.0, 4.0)]
    assert found == pytest.approx([0.2, 0.1, 0.0, 0.0], abs=1e-12)


def test_there_is_no_virtual_mass_until_requested():
    assert VirtualMass().at(5 * S) == 0.0


@pytest.mark.parametrize("mass", [0.0, MAX_VIRTUAL_MASS])
def test_the_ends_of_the_range_are_allowed(mass):
    virtual = VirtualMass()
    virtual.aim(mass, 0)
    assert virtual.at(9 * S) == mass


@pytest.mark.parametrize("mass", [-1e-9, 2.000001, float("nan")])
def test_a_mass_out_of_range_is_refused_and_changes_nothing(mass):
    virtual = VirtualMass()
    virtual.aim(1.0, 0)
    with pytest.raises(ValueError, match=r"0\.\.2"):
        virtual.aim(mass, 1 * S)
    assert virtual.at(9 * S) == 1.0
