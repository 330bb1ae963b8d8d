import numpy as np
import pytest

from wam.model.arm_model import ArmModel, drive_inertia_matrix
from wam.model.constants import GRAVITY, load_constants
from wam.model.tool import Tool, box_inertia, sensor_body

POSES = ["zero", "home", "elbow_square", "foot_down", "generic_a", "generic_b"]
STROKES = ["pass_l1", "pass_l2", "pass_w1", "pass_w2"]
EXACT = 1e-9  # far above rounding, far below any millimetre or N m that matters


@pytest.fixture(scope="module")
def bare():
    return ArmModel(load_constants())


@pytest.fixture(params=POSES)
def vector(request, arm_vectors):
    found = {vector["name"]: vector for vector in arm_vectors["vectors"]}
    return found[request.param]


@pytest.fixture
def q(vector):
    return np.array(vector["q"])


def close(found, expected, atol=EXACT):
    return np.allclose(found, np.array(expected, float), rtol=0.0, atol=atol)


def test_the_plate_pose_agrees_with_two_independent_programs(bare, q, vector):
    position, rotation = bare.plate_pose(q)
    assert close(position, vector["tool_position"])
    assert close(rotation, vector["tool_rotation"])


def test_the_jacobian_of_the_plate_agrees(bare, q, vector):
    expected = vector["jacobian_world_linear_then_angular"]
    assert close(bare.plate_jacobian(q), expected)


def test_the_holding_torque_agrees(bare, q, vector):
    assert close(bare.gravity(q), vector["gravity"])


def test_the_holding_torque_with_sensor_and_foot_agrees(foot_model, q, vector):
    assert close(foot_model.gravity(q), vector["gravity_with_sensor_and_foot"])


def test_the_mass_matrix_of_the_links_agrees(bare, q, vector):
    assert close(bare.mass_matrix(q, with_drive=False), vector["mass_matrix"])


def test_the_mass_matrix_with_the_drives_agrees(bare, q, vector):
    assert close(bare.mass_matrix(q), vector["mass_matrix_with_drive"])


def test_coriolis_and_centrifugal_torques_agree(bare, q, vector):
    assert close(bare.coriolis(q, np.array(vector["qd"])), vector["coriolis"])


def test_the_sole_agrees(foot_model, q, vector):
    position, rotation = foot_model.sole_pose(q)
    assert close(position, vector["sole_position"])
    assert close(rotation, vector["tool_rotation"])


def test_the_centre_of_the_foot_agrees(foot_model, q, vector):
    assert close(foot_model.foot_com_position(q), vector["foot_com_position"])


def test_the_torque_of_a_weight_at_the_foot_agrees(foot_model, q, vector):
    assert close(foot_model.weight_torque(q, 0.3), vector["virtual_weight_torque"])


def test_the_motion_of_the_sole_agrees_with_pose_and_jacobian(foot_model, q, vector):
    qd = np.array(vector["qd"])
    pose, rotation, twist = foot_model.sole_motion(q, qd)
    assert close(pose[:3], vector["sole_position"])
    assert close(rotation, vector["tool_rotation"])
    assert close(twist, foot_model.sole_jacobian(q) @ qd)


def test_the_jacobian_of_the_sole_is_the_slope_of_its_position(foot_model, q):
    step = 1e-6
    slope = [
        (foot_model.sole_pose(q + d)[0] - foot_model.sole_pose(q - d)[0]) / (2 * step)
        for d in step * np.eye(7)
    ]
    # central differences: rounding 1e-16 m over a step of 1e-6 rad
    assert close(foot_model.sole_jacobian(q)[:3], np.transpose(slope), atol=1e-8)


def test_a_path_is_evaluated_at_every_pose(foot_model, arm_vectors):
    q = np.array([vector["q"] for vector in arm_vectors["vectors"]])
    path = foot_model.sole_path(q)
    expected = [vector["sole_position"] for vector in arm_vectors["vectors"]]
    assert path.position.shape == (6, 3)
    assert path.rotation.shape == (6, 3, 3)
    assert close(path.position, expected)
    assert close(path.rotation, [v["tool_rotation"] for v in arm_vectors["vectors"]])


def test_an_empty_path_has_no_poses(foot_model):
    path = foot_model.sole_path(np.empty((0, 7)))
    assert (path.position.shape, path.rotation.shape) == ((0, 3), (0, 3, 3))


def test_the_drive_inertia_is_the_rotors_seen_through_the_transmission():
    matrix = drive_inertia_matrix(load_constants())
    diagonal = [0.2052, 0.1888, 0.0669, 0.0346, 0.00323, 0.00323, 0.00032]
    assert np.allclose(np.diag(matrix), diagonal, rtol=0.016)  # two digits
    assert matrix[4, 5] == pytest.approx(5.6e-5, rel=0.02)
    assert np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-15)  # rounding


RESULTS = {
    "gravity": lambda m, q: m.gravity(q),
    "weight": lambda m, q: m.weight_torque(q, 1.0),
    "mass": lambda m, q: m.mass_matrix(q, with_drive=False),
    "coriolis": lambda m, q: m.coriolis(q, q),
    "plate": lambda m, q: m.plate_pose(q)[0],
    "rotation": lambda m, q: m.sole_pose(q)[1],
    "com": lambda m, q: m.foot_com_position(q),
    "jacobian": lambda m, q: m.sole_jacobian(q),
    "motion pose": lambda m, q: m.sole_motion(q, q)[0],
    "motion rotation": lambda m, q: m.sole_motion(q, q)[1],
    "motion twist": lambda m, q: m.sole_motion(q, q)[2],
}


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_does_not_change_with_the_next_call(foot_model, name):
    found = RESULTS[name](foot_model, np.full(7, 0.1))
    kept = found.copy()
    other = RESULTS[name](foot_model, np.full(7, 0.7))
    assert np.array_equal(found, kept)
    assert not np.array_equal(found, other)


def test_a_model_without_a_tool_ends_at_the_plate(bare):
    q = np.full(7, 0.3)
    assert np.array_equal(bare.sole_pose(q)[0], bare.plate_pose(q)[0])


def test_the_quaternion_of_a_motion_agrees_with_its_rotation_matrix(foot_model, q):
    pose, rotation, _ = foot_model.sole_motion(q, q)
    x, y, z, w = pose[3:]
    v = np.array([x, y, z])
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rebuilt = (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * cross
    assert close(rebuilt, rotation)
    assert w >= 0.0


def test_the_quaternion_of_a_motion_never_changes_its_sign(foot_model):
    turns = np.linspace(-3.0, 3.0, 50)  # of joint 7: some would have a negative sign
    poses = [foot_model.sole_motion(t * np.eye(7)[6], np.zeros(7))[0] for t in turns]
    assert min(pose[6] for pose in poses) >= 0.0


def test_a_box_has_the_inertia_of_a_box():
    assert np.allclose(
        box_inertia(12.0, (1.0, 2.0, 3.0)), np.diag([13.0, 10.0, 5.0]), rtol=1e-15
    )


def test_a_heavier_foot_needs_more_holding_torque(bare, foot_model):
    q = np.array([0, 0.9, 0, 1.6, 0, np.pi - 2.5, 0])
    tool = foot_model.tool
    lifted = bare.gravity(q) - foot_model.gravity(q)
    arm = foot_model.foot_com_position(q)[0] * tool.foot.mass
    arm += bare.plate_pose(q)[0][0] * tool.sensor.mass
    assert lifted[1] == pytest.approx(arm * GRAVITY, abs=1e-9)  # lever times weight


@pytest.mark.shared_data
@pytest.mark.parametrize("name", STROKES)
def test_a_recorded_arm_agrees_with_the_model(shared_data, name):
    path = shared_data / "real" / "wam_surface_fk" / f"{name}.csv"
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    q = np.zeros((len(table), 7))
    q[:, :4] = table[:, 4:8]
    tip = Tool(sensor_body(), sensor_body(), sole=np.array([0.0, 0.0, 0.1591]))
    found = ArmModel(load_constants(), tip).sole_path(q).position
    worst = np.linalg.norm(found - table[:, 1:4], axis=1).max()
    assert len(table) > 200
    assert worst < 10e-6  # the log has six digits
