"""Check of payload and mounting by the measured weight of the free foot.

The gravity force has magnitude and direction, so a wrong mass, a wrong sign and a
sensor turned about its axis can be told apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ft_sensor.payload import Floats, Payload
from wam.model.constants import Array

LARGEST_TURN = np.radians(12.0)  # apparent turn of a sound sensor, cable and zero
_NOISE = 0.3  # N normal to z, by drift, cable and hysteresis
_EXPLAINED = 0.5  # largest share of the error that remains for an accepted cause


class WeightCause(StrEnum):
    """Cause of a difference between measured and expected weight."""

    MASS = "mass"
    SIGN = "sign"
    TURNED = "turned"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class WeightChange:
    """Measured weight of the free foot compared with the expected one.

    Attributes:
        error: largest difference from the expected weight [N].
        turned: turn of the sensor about z that fits best [rad], -pi..pi.
        scale: factor of the mass that fits best; negative: wrong sign.
        across: expected weight normal to z, on which a turn has an effect [N].
        cause: best explanation.
    """

    error: float
    turned: float
    scale: float
    across: float
    cause: WeightCause

    @property
    def is_turned(self) -> bool:
        """Whether a turn of the sensor is significant, given the foot's weight."""
        is_significant = self.across * abs(np.sin(self.turned)) > _NOISE
        is_large = abs(self.turned) > LARGEST_TURN
        return self.cause is WeightCause.TURNED and is_large and bool(is_significant)


def compare_weights(expected: Floats, seen: Floats) -> WeightChange:
    """Compare measured with expected forces.

    Args:
        expected: by payload, mounting and pose, without bias [N], shape (n, 3).
        seen: measured, without bias [N], shape (n, 3).
    """
    x, y = expected[:, 0], expected[:, 1]
    u, v = seen[:, 0], seen[:, 1]
    # The weight turns opposite to the sensor frame.
    angle = -float(np.arctan2((x * v - y * u).sum(), (x * u + y * v).sum()))
    c, s = np.cos(angle), np.sin(angle)
    turned = expected @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    size = float((expected * expected).sum())
    scale = float((expected * seen).sum()) / size if size > 0.0 else 1.0
    by_scale = WeightCause.SIGN if scale < 0.0 else WeightCause.MASS
    residuals = {
        by_scale: float(np.linalg.norm(seen - scale * expected)),
        WeightCause.TURNED: float(np.linalg.norm(seen - turned)),
    }
    cause = min(residuals, key=lambda candidate: residuals[candidate])
    if residuals[cause] > _EXPLAINED * float(np.linalg.norm(seen - expected)):
        cause = WeightCause.UNKNOWN
    return WeightChange(
        error=float(np.linalg.norm(seen - expected, axis=1).max()),
        turned=angle,
        scale=scale,
        across=float(np.linalg.norm(expected[:, :2], axis=1).max()),
        cause=cause,
    )


def weight_change(
    payload: Payload, rotations: Sequence[Array], readings: Sequence[Array]
) -> WeightChange:
    """Compare the change of the reading between two poses with that of the weight.

    The sensor's bias cancels.

    Args:
        payload: payload and mounting.
        rotations: orientations of frame 7 in both poses, shape (3, 3) each.
        readings: mean raw wrenches, the foot free [N, N m], shape (6,) each.
    """
    first, second = (payload.sign * payload.weight(R)[:3] for R in rotations)
    seen = (readings[1] - readings[0])[:3]
    return compare_weights((second - first)[None, :], seen[None, :])


def measured_weight(payload: Payload, rotation: Array, known: Array) -> WeightChange:
    """Compare the weight removed by a tare with that of the payload.

    Args:
        payload: tared payload.
        rotation: orientation of frame 7 during the tare, shape (3, 3).
        known: reading of the sensor without any load [N, N m], shape (6,).
    """
    expected = payload.sign * payload.weight(rotation)[:3]
    seen = expected + (payload.bias - known)[:3]
    return compare_weights(expected[None, :], seen[None, :])
