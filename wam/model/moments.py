"""Gravity from seven first moments, and their calibration by least squares.

Without masses, the holding torque is linear in mu_j (kg m, frame j), from the tip:

    t_j = g_j x mu_j + R_{j+1} t_{j+1},   tau_j = (R_j t_j)_z

g_j is gravity in frame j, R_j rotates from frame j to frame j - 1. Only 12 of the 21
parameters are identifiable from torques: compare torques, never moments.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from wam.model.constants import GRAVITY, ArmConstants, Array, Body

OBSERVABLE = 12  # identifiable parameters of the 21
LARGEST_RESIDUAL = 0.5  # N m rms over all joints and poses
LARGEST_CONDITION = 30.0  # of the identifiable part; the shipped poses have 7
LARGEST_ZERO_ERROR = 3.0  # degrees
FARTHEST = 5.0  # N m from the drawings; another arm's moments differ by at most 2.3
IDENTIFIABLE_ZEROS = (
    2,
    3,
    4,
    5,
)  # joints whose zero error is identifiable from torques
_TURN = 1e-5  # step of the finite difference [rad]
_LEAST_NOISE = 0.01  # lower bound of the torque noise [N m]
_SINGULAR = 1e-3  # of the largest singular value; smaller ones count as zero


def regressor(constants: ArmConstants, q: Array, gravity: float = GRAVITY) -> Array:
    """Return Y with tau = Y mus.ravel() for joint positions `q`, shape (7, 21)."""
    rotations = [_rotation(constants, joint, float(q[joint])) for joint in range(7)]
    down = np.array([0.0, 0.0, -gravity])
    Y = np.zeros((7, 21))
    to_base = np.eye(3)
    columns: list[Array] = []
    for joint in range(7):
        to_base = to_base @ rotations[joint]
        x, y, z = to_base.T @ down
        columns.append(np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))
    for joint in range(7):
        block = columns[joint]
        for above in range(joint, -1, -1):
            block = rotations[above] @ block
            Y[above, 3 * joint : 3 * joint + 3] = block[2]
    return Y


def gravity_torque(
    constants: ArmConstants, mus: Array, q: Array, gravity: float = GRAVITY
) -> Array:
    """Return the holding torques of first moments `mus` [N m], shape (7,)."""
    return regressor(constants, q, gravity) @ mus.ravel()


def moments_of_links(constants: ArmConstants, bodies: tuple[Body, ...] = ()) -> Array:
    """Return first moments from the masses of the links [kg m], shape (7, 3).

    mu_j = m_j com_j + (m_j + ... + m_7) r_j with r_j the vector from frame j - 1 to
    frame j, in frame j. `bodies` are on the tool plate, in frame 7.
    """
    mus = np.zeros((7, 3))
    carried = 0.0
    for body in bodies:
        mus[6] += body.mass * body.com
        carried += body.mass
    for joint in range(6, -1, -1):
        link = constants.links[joint]
        carried += link.mass
        mus[joint] += link.mass * link.com + carried * _step(constants, joint)
    return mus


def links_of_moments(constants: ArmConstants, mus: Array) -> tuple[Body, ...]:
    """Return links of 1 kg each whose first moments are `mus` [kg m], shape (7, 3).

    Their gravity torques equal those of `mus` in every pose, so a rigid-body library
    can evaluate them; their inertia is not valid.
    """
    none = np.zeros((3, 3))
    return tuple(
        Body(1.0, mus[joint] - (7 - joint) * _step(constants, joint), none)
        for joint in range(7)
    )


@dataclass(frozen=True, slots=True)
class MomentFit:
    """Outcome of a gravity calibration.

    Attributes:
        mus: first moments of least norm, mounted tool included [kg m], shape (7, 3).
        rank: rank of the regressor over the poses, 12 at best.
        condition: ratio of the largest to the smallest nonzero singular value.
        residuals: measured minus predicted torques [N m], shape (n, 7).
    """

    mus: Array
    rank: int
    condition: float
    residuals: Array

    @property
    def residual(self) -> float:
        """Rms of the residuals over all joints and poses [N m]."""
        return float(np.sqrt(np.mean(self.residuals**2)))


def fit_moments(
    constants: ArmConstants, q: NDArray[np.float64], tau: NDArray[np.float64]
) -> MomentFit:
    """Fit first moments to holding torques: gravity calibration by least squares.

    Args:
        constants: constants of the arm.
        q: joint positions at rest [rad], shape (n, 7).
        tau: holding torques without friction [N m], shape (n, 7).
    """
    if q.shape != tau.shape or q.ndim != 2 or q.shape[1] != 7:
        raise ValueError(f"q and tau must be (n, 7), got {q.shape} and {tau.shape}")
    Y = np.vstack([regressor(constants, row) for row in q])
    mus = np.linalg.lstsq(Y, tau.ravel(), rcond=_SINGULAR)[0]
    return evaluate_moments(
        constants, np.asarray(mus, np.float64).reshape(7, 3), q, tau
    )


def evaluate_moments(
    constants: ArmConstants,
    mus: Array,
    q: NDArray[np.float64],
    tau: NDArray[np.float64],
) -> MomentFit:
    """Return rank, condition and residuals of given first moments.

    Args:
        constants: constants of the arm.
        mus: first moments [kg m], shape (7, 3).
        q: joint positions at rest [rad], shape (n, 7).
        tau: holding torques without friction [N m], shape (n, 7).
    """
    Y = np.vstack([regressor(constants, row) for row in q])
    values = np.linalg.svd(Y, compute_uv=False)
    rank = int(np.count_nonzero(values > _SINGULAR * values[0]))
    return MomentFit(
        mus=mus,
        rank=rank,
        condition=float(values[0] / values[rank - 1]),
        residuals=tau - (Y @ mus.ravel()).reshape(tau.shape),
    )


@dataclass(frozen=True, slots=True)
class ZeroErrors:
    """Estimated zero errors of the joints.

    Attributes:
        joints: numbers of the joints with an identifiable zero error.
        errors: true minus reported position [rad], shape (4,).
        deviations: standard deviations of the errors [rad], shape (4,).
    """

    joints: tuple[int, ...]
    errors: Array
    deviations: Array


def zero_errors(
    constants: ArmConstants, q: NDArray[np.float64], fit: MomentFit
) -> ZeroErrors:
    """Estimate the zero errors of joints 2 to 5 from the residuals of a fit.

    To first order residuals = P (dg/dq) e, with P the projection on the complement of
    the regressor's range. The zero errors of joints 1 and 7 are not identifiable (a
    vertical axis; moments that turn with the joint), that of joint 6 hardly: 1 N m
    would be 1000 degrees.

    Args:
        constants: constants of the arm.
        q: joint positions at rest [rad], shape (n, 7).
        fit: fit of the torques at `q`.
    """
    Y = np.vstack([regressor(constants, row) for row in q])
    basis = np.linalg.svd(Y, full_matrices=False)[0][:, : fit.rank]
    slopes = np.empty((len(Y), len(IDENTIFIABLE_ZEROS)))
    for column, joint in enumerate(IDENTIFIABLE_ZEROS):
        displaced = q.copy()
        displaced[:, joint - 1] += _TURN
        Y_displaced = np.vstack([regressor(constants, row) for row in displaced])
        slope = (Y_displaced - Y) @ fit.mus.ravel() / _TURN
        slopes[:, column] = slope - basis @ (basis.T @ slope)
    residuals = fit.residuals.ravel()
    errors = np.linalg.lstsq(slopes, residuals)[0]
    remaining = residuals - slopes @ errors
    freedom = max(len(remaining) - fit.rank - len(IDENTIFIABLE_ZEROS), 1)
    noise = max(float(remaining @ remaining) / freedom, _LEAST_NOISE**2)
    covariance = noise * np.linalg.pinv(slopes.T @ slopes)
    deviations = np.sqrt(np.diag(covariance))
    return ZeroErrors(
        IDENTIFIABLE_ZEROS,
        np.asarray(errors, np.float64),
        np.asarray(deviations, np.float64),
    )


def check_zeros(zeros: ZeroErrors) -> None:
    """Refuse an arm that was zeroed away from home according to its gravity torques.

    Raises:
        SettingsError: a zero error exceeds 3 degrees and four standard deviations.
    """
    degrees, thresholds = np.degrees(zeros.errors), 4.0 * np.degrees(zeros.deviations)
    ratios = np.abs(degrees) / np.maximum(thresholds, LARGEST_ZERO_ERROR)
    worst = int(ratios.argmax())
    if ratios[worst] <= 1.0:
        return
    raise SettingsError(
        f"Joint {zeros.joints[worst]} seems to be zeroed {degrees[worst]:+.1f} degrees "
        f"away from home (limit {LARGEST_ZERO_ERROR:g}, standard deviation "
        f"{thresholds[worst] / 4.0:.1f}), by its gravity torques.",
        hint="Bring the arm home and zero it anew: traction zero.",
    )


def check_drawings(
    constants: ArmConstants, mus: Array, bodies: tuple[Body, ...], q: Array
) -> None:
    """Refuse first moments far from the drawings.

    Args:
        constants: constants of the arm by its drawings.
        mus: first moments including `bodies` [kg m], shape (7, 3).
        bodies: bodies on the tool plate during the measurement.
        q: joint positions of the comparison [rad], shape (n, 7).

    Raises:
        SettingsError: a gravity torque differs by more than 5 N m.
    """
    change = (mus - moments_of_links(constants, bodies)).ravel()
    differences = np.array([regressor(constants, row) @ change for row in q])
    pose, joint = np.unravel_index(np.abs(differences).argmax(), differences.shape)
    worst = float(abs(differences[pose, joint]))
    if not worst <= FARTHEST:
        raise SettingsError(
            f"The gravity torque differs by {worst:.1f} N m from the drawings at joint "
            f"{joint + 1} in pose {pose + 1} (limit {FARTHEST:g}).",
            hint="Is the tool in rig.toml the one that was on, and the arm zeroed at "
            "home?",
        )


def check_fit(fit: MomentFit) -> None:
    """Refuse a fit that is not good enough to float the arm.

    Raises:
        SettingsError: rank below 12, condition above 30, or residual above 0.5 N m rms.
    """
    if fit.rank < OBSERVABLE:
        raise SettingsError(
            f"The poses show {fit.rank} of {OBSERVABLE} directions of gravity.",
            hint="Use more poses, or more different ones.",
        )
    if fit.condition > LARGEST_CONDITION:
        raise SettingsError(
            f"The poses show gravity unevenly: condition {fit.condition:.0f} "
            f"(limit {LARGEST_CONDITION:.0f}).",
            hint="Use more poses, or more different ones.",
        )
    if not fit.residual <= LARGEST_RESIDUAL:
        pose, joint = np.unravel_index(
            np.abs(fit.residuals).argmax(), (len(fit.residuals), 7)
        )
        raise SettingsError(
            f"The torques leave {fit.residual:.2f} N m unexplained "
            f"(limit {LARGEST_RESIDUAL}), most at joint {joint + 1} in pose "
            f"{pose + 1}.",
            hint="Was the arm touched, or the tool changed meanwhile?",
        )


def _rotation(constants: ArmConstants, joint: int, angle: float) -> Array:
    """Return R_j = Rz(q) Rx(alpha) of joint `joint` (0-6)."""
    c, s = np.cos(angle), np.sin(angle)
    ca, sa = np.cos(constants.alpha[joint]), np.sin(constants.alpha[joint])
    return np.array([[c, -s * ca, s * sa], [s, c * ca, -c * sa], [0.0, sa, ca]])


def _step(constants: ArmConstants, joint: int) -> Array:
    """Return r_j = (a, d sin alpha, d cos alpha) [m]."""
    alpha, d = constants.alpha[joint], constants.d[joint]
    return np.array([constants.a[joint], d * np.sin(alpha), d * np.cos(alpha)])
