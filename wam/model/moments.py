"""Gravity from seven first moments, and their calibration by least squares.

Without masses, the holding torque is linear in mu_j (kg m, frame j), from the tip:

    t_j = g_j x mu_j + R_{j+1} t_{j+1},   tau_j = (R_j t_j)_z

g_j is gravity in frame j, R_j turns frame j into frame j - 1. Only 12 of the 21 numbers
can be seen in the torques: compare torques, never moments.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from wam.model.constants import GRAVITY, ArmConstants, Array, Body

OBSERVABLE = 12  # numbers of the 21 that show in the torques
LARGEST_RESIDUAL = 0.5  # N m rms over all joints and poses
LARGEST_CONDITION = 30.0  # of what is observable; the shipped poses have 7
LARGEST_ZERO_ERROR = 3.0  # degrees
FARTHEST = 5.0  # N m from the drawings; another arm's moments are 2.3 off at most
SEEN_ZEROS = (2, 3, 4, 5)  # joints whose zero shows in the torques
_TURN = 1e-5  # rad of a difference that stands for a slope
_LEAST_NOISE = 0.01  # N m that torques are known to at best
_SINGULAR = 1e-3  # of the largest singular value: below it a direction is not seen


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
    """Return the torques that hold an arm of first moments `mus` [N m], shape (7,)."""
    return regressor(constants, q, gravity) @ mus.ravel()


def moments_of_links(constants: ArmConstants, bodies: tuple[Body, ...] = ()) -> Array:
    """Return the first moments of the links by their masses [kg m], shape (7, 3).

    mu_j = m_j com_j + (m_j + ... + m_7) r_j with r_j the step from frame j - 1 to
    frame j, in frame j. `bodies` hang on the tool plate, in frame 7.
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

    They weigh what the arm weighs in every pose, so a rigid-body library evaluates
    `mus` at its own speed; their inertia means nothing.
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
        mus: first moments of least norm [kg m], shape (7, 3); with the tool that was
            fitted.
        rank: directions that the poses showed, 12 at best.
        condition: largest over smallest of the singular values of those directions.
        residuals: measured less explained torques [N m], shape (n, 7).
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
    """Fit first moments to holding torques; `check_fit` says whether to trust them.

    Args:
        constants: of the arm.
        q: joint positions at rest [rad], shape (n, 7).
        tau: holding torques there, free of friction [N m], shape (n, 7).
    """
    if q.shape != tau.shape or q.ndim != 2 or q.shape[1] != 7:
        raise ValueError(f"q and tau must be (n, 7), got {q.shape} and {tau.shape}")
    Y = np.vstack([regressor(constants, row) for row in q])
    mus = np.linalg.lstsq(Y, tau.ravel(), rcond=_SINGULAR)[0]
    return fit_of(constants, np.asarray(mus, np.float64).reshape(7, 3), q, tau)


def fit_of(
    constants: ArmConstants,
    mus: Array,
    q: NDArray[np.float64],
    tau: NDArray[np.float64],
) -> MomentFit:
    """Return how well given moments explain holding torques, as `fit_moments` does.

    Args:
        constants: of the arm.
        mus: first moments [kg m], shape (7, 3).
        q: joint positions at rest [rad], shape (n, 7).
        tau: holding torques there, free of friction [N m], shape (n, 7).
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
    """Errors of the joints' zeros that would explain the torques better.

    Attributes:
        joints: numbers of the joints whose zero shows in the torques.
        errors: true less believed position of each [rad], shape (4,).
        deviations: standard deviation of each [rad], shape (4,).
    """

    joints: tuple[int, ...]
    errors: Array
    deviations: Array


def zero_errors(
    constants: ArmConstants, q: NDArray[np.float64], fit: MomentFit
) -> ZeroErrors:
    """Return what the residuals of a fit say about the zeros of joints 2 to 5.

    To first order residuals = P (dg/dq) e, with P the projection on what no moments
    explain. The zeros of joints 1 and 7 do not show at all (a vertical axis, and
    moments that turn with it), that of joint 6 hardly: 1 N m would be 1000 degrees.

    Args:
        constants: of the arm.
        q: joint positions at rest [rad], shape (n, 7).
        fit: of the torques there.
    """
    Y = np.vstack([regressor(constants, row) for row in q])
    seen = np.linalg.svd(Y, full_matrices=False)[0][:, : fit.rank]
    slopes = np.empty((len(Y), len(SEEN_ZEROS)))
    for column, joint in enumerate(SEEN_ZEROS):
        turned = q.copy()
        turned[:, joint - 1] += _TURN
        later = np.vstack([regressor(constants, row) for row in turned])
        slope = (later - Y) @ fit.mus.ravel() / _TURN
        slopes[:, column] = slope - seen @ (seen.T @ slope)
    residuals = fit.residuals.ravel()
    errors = np.linalg.lstsq(slopes, residuals)[0]
    left = residuals - slopes @ errors
    free = max(len(left) - fit.rank - len(SEEN_ZEROS), 1)
    noise = max(float(left @ left) / free, _LEAST_NOISE**2)
    covariance = noise * np.linalg.pinv(slopes.T @ slopes)
    deviations = np.sqrt(np.diag(covariance))
    return ZeroErrors(
        SEEN_ZEROS, np.asarray(errors, np.float64), np.asarray(deviations, np.float64)
    )


def check_zeros(found: ZeroErrors) -> None:
    """Refuse an arm whose torques say that it was zeroed away from home.

    Raises:
        SettingsError: a joint is further off than 3 degrees, and than four standard
            deviations.
    """
    degrees, sure = np.degrees(found.errors), 4.0 * np.degrees(found.deviations)
    beyond = np.abs(degrees) / np.maximum(sure, LARGEST_ZERO_ERROR)
    worst = int(beyond.argmax())
    if beyond[worst] <= 1.0:
        return
    raise SettingsError(
        f"Joint {found.joints[worst]} seems to be zeroed {degrees[worst]:+.1f} degrees "
        f"away from home (limit {LARGEST_ZERO_ERROR:g}, standard deviation "
        f"{sure[worst] / 4.0:.1f}): its weight pulls elsewhere.",
        hint="Bring the arm home and zero it anew: traction zero.",
    )


def check_drawings(
    constants: ArmConstants, mus: Array, bodies: tuple[Body, ...], q: Array
) -> None:
    """Refuse moments of no such arm.

    Args:
        constants: of the arm by its drawings.
        mus: first moments [kg m], shape (7, 3), with `bodies`.
        bodies: that hung on the tool plate.
        q: joint positions at which they are compared [rad], shape (n, 7).

    Raises:
        SettingsError: somewhere they are more than 5 N m off.
    """
    change = (mus - moments_of_links(constants, bodies)).ravel()
    off = np.array([regressor(constants, row) @ change for row in q])
    pose, joint = np.unravel_index(np.abs(off).argmax(), off.shape)
    worst = float(abs(off[pose, joint]))
    if not worst <= FARTHEST:
        raise SettingsError(
            f"The arm would weigh {worst:.1f} N m otherwise than drawn at joint "
            f"{joint + 1} in pose {pose + 1} (limit {FARTHEST:g}).",
            hint="Is the tool in rig.toml the one that was on, and the arm zeroed at "
            "home?",
        )


def check_fit(fit: MomentFit) -> None:
    """Refuse a fit that would not float the arm.

    Raises:
        SettingsError: the poses show fewer than 12 directions or some of them poorly,
            or no moments explain the torques to 0.5 N m.
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
