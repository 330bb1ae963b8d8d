"""Inverse kinematics: joint positions that put the sole flat on a plane."""

import numpy as np

from acquisition.errors import SettingsError
from wam.model.arm_model import ArmModel
from wam.model.constants import Array

_CLOSE = 1e-9  # convergence of the iteration [m], [rad]
_LARGEST_STEP = 0.5  # rad
_STEPS = 60  # iterations from a seed
_DAMPING = 1e-3  # damping of the iteration
# Joints 2, 4 and 6 with the elbow up, reaching far, mid and near [rad].
_SEEDS = ((0.77, 1.19, 1.19), (0.35, 1.75, 1.0), (1.1, 0.7, 1.3))
_TWISTED = 0.8  # largest angle of joints 3, 5 and 7 [rad]


def lowered_to(
    model: ArmModel, axes: Array, far_end: Array, q: Array, height: float
) -> Array:
    """Return joint positions near `q` with the sole `height` [m] above a point.

    The sole is parallel to the plane. Newton's method on joints 2, 4 and 6.

    Args:
        model: the arm with its tool.
        axes: rows x_T, y_T, z_T of the plane in the base frame, shape (3, 3).
        far_end: the point [m], shape (3,).
        q: initial joint positions [rad], shape (7,).
        height: height above the point along z_T [m].

    Raises:
        SettingsError: no convergence: out of reach, or `q` is singular.
    """
    goal = far_end + height * axes[2]
    start, q, joints = q, q.copy(), [1, 3, 5]
    for _ in range(20):
        position, rotation = model.sole_pose(q)
        error = axes @ (goal - position)
        turn = np.cross(rotation[:, 2], -axes[2]) @ axes[1]
        if abs(error[0]) + abs(error[2]) < _CLOSE and abs(turn) < _CLOSE:
            return q
        J = model.sole_jacobian(q)[:, joints]
        rows = np.vstack([axes[[0, 2]] @ J[:3], axes[1] @ J[3:]])
        step = np.linalg.lstsq(rows, np.array([error[0], error[2], turn]))[0]
        q[joints] += np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
    raise SettingsError(
        f"matrix.toml: the foot cannot stand at far_end = {far_end.tolist()} "
        f"from start_q = {start.tolist()}.",
        hint="Correct far_end or start_q of this terrain. Nothing was started.",
    )


def elbow_up(model: ArmModel, axes: Array, far_end: Array) -> Array:
    """Return joint positions with the sole flat on a point, elbow up, shape (7,).

    The foot points along the plane, toward the base or away from it. Damped Newton on
    all joints from three seeds; the solution with the smallest |q3| + |q5| + |q7|.

    Args:
        model: the arm with its tool.
        axes: rows x_T, y_T, z_T of the plane in the base frame, shape (3, 3).
        far_end: the point [m], shape (3,).

    Raises:
        SettingsError: no solution within the joint stops.
    """
    solutions: list[Array] = []
    shoulder = float(np.arctan2(far_end[1], far_end[0]))
    for second, fourth, sixth in _SEEDS:
        seed = np.array([shoulder, second, 0.0, fourth, 0.0, sixth, 0.0])
        for heading in (1.0, -1.0):
            q = _solution(model, axes, far_end, seed.copy(), heading)
            if q is not None:
                solutions.append(q)
    if not solutions:
        raise SettingsError(
            f"The arm cannot put the sole flat on far_end = "
            f"{np.round(far_end, 4).tolist()}: out of reach, or beyond its stops.",
            hint="Correct far_end or the incline, or state start_q. Nothing was "
            "started.",
        )
    return min(solutions, key=lambda q: float(np.abs(q[[2, 4, 6]]).sum()))


def _solution(
    model: ArmModel, axes: Array, goal: Array, q: Array, heading: float
) -> Array | None:
    """Return the solution reached from a seed; None if none within the stops.

    Args:
        model: the arm.
        axes: axes of the plane.
        goal: point for the sole [m].
        q: the seed; modified.
        heading: 1 = the foot's x axis against x_T, -1 = along it.
    """
    target = np.column_stack([-heading * axes[0], heading * axes[1], -axes[2]])
    lower, upper = model.constants.q_lower, model.constants.q_upper
    for _ in range(_STEPS):
        position, rotation = model.sole_pose(q)
        rotation_error = 0.5 * sum(
            (np.cross(rotation[:, k], target[:, k]) for k in range(3)), np.zeros(3)
        )
        error = np.concatenate([goal - position, rotation_error])
        is_aligned = float(np.einsum("ij,ij->", rotation, target)) > 2.9
        if is_aligned and float(np.abs(error).max()) < _CLOSE:
            is_within = bool(((lower < q) & (q < upper)).all())
            is_plain = float(np.abs(q[[2, 4, 6]]).max()) < _TWISTED
            return q if is_within and is_plain and q[3] > 0.0 else None
        J = model.sole_jacobian(q)
        damped = J @ J.T + _DAMPING * float(error @ error) * np.eye(6)
        q += np.clip(J.T @ np.linalg.solve(damped, error), -0.3, 0.3)
    return None
