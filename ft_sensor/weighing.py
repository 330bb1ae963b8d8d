"""The weight of the free foot in the sensor, against what payload and mounting say.

Gravity shows size and direction, so a wrong mass, the other sign and a sensor turned
about its axis differ: each changes the expected forces in a way of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ft_sensor.payload import Floats, Payload
from wam.model.constants import Array

LARGEST_TURN = np.radians(12.0)  # that a sound sensor, cable and zero may show
_NOISE = 0.3  # N across z: what drift, cable and hysteresis make of two readings
_EXPLAINED = 0.5  # of the error: a cause leaves no more than that


class WeightCause(StrEnum):
    """What explains that the weight is not seen as expected."""

    MASS = "mass"
    SIGN = "sign"
    TURNED = "turned"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class WeightChange:
    """How the weight of the free foot is seen, compared with what is expected.

    Attributes:
        error: largest difference from what payload and mounting say [N].
        turned: angle about z by which the sensor itself would have to be turned to see
            it so [rad], -pi..pi.
        scale: by which the mass would have to be multiplied; below 0: the other sign.
        across: how much of the expected weight is across z, where a turn shows [N].
        cause: what explains it best.
    """

    error: float
    turned: float
    scale: float
    across: float
    cause: WeightCause

    @property
    def is_turned(self) -> bool:
        """Whether the sensor is surely turned, however light the foot is."""
        is_clear = self.across * abs(np.sin(self.turned)) > _NOISE
        is_far = abs(self.turned) > LARGEST_TURN
        return self.cause is WeightCause.TURNED and is_far and bool(is_clear)


def compare_weights(expected: Floats, seen: Floats) -> WeightChange:
    """Compare forces that the sensor shows with those that are expected.

    Args:
        expected: by payload, mounting and joints, without a bias [N], shape (n, 3).
        seen: by the sensor, without its bias [N], shape (n, 3).
    """
    x, y = expected[:, 0], expected[:, 1]
    u, v = seen[:, 0], seen[:, 1]
    # The sensor's frame turns, so the weight turns in it the other way.
    angle = -float(np.arctan2((x * v - y * u).sum(), (x * u + y * v).sum()))
    c, s = np.cos(angle), np.sin(angle)
    turned = expected @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    size = float((expected * expected).sum())
    scale = float((expected * seen).sum()) / size if size > 0.0 else 1.0
    by_scale = WeightCause.SIGN if scale < 0.0 else WeightCause.MASS
    left = {
        by_scale: float(np.linalg.norm(seen - scale * expected)),
        WeightCause.TURNED: float(np.linalg.norm(seen - turned)),
    }
    cause = min(left, key=lambda each: left[each])
    if left[cause] > _EXPLAINED * float(np.linalg.norm(seen - expected)):
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

    The sensor's bias is in both poses and cancels.

    Args:
        payload: what the sensor carries, and its mounting.
        rotations: orientation of frame 7 in both poses, shape (3, 3) each.
        readings: mean raw wrench there, the foot free [N, N m], shape (6,) each.
    """
    first, second = (payload.sign * payload.weight(R)[:3] for R in rotations)
    seen = (readings[1] - readings[0])[:3]
    return compare_weights((second - first)[None, :], seen[None, :])


def weight_seen(payload: Payload, rotation: Array, known: Array) -> WeightChange:
    """Compare the weight that a tare took away with that of the payload.

    Args:
        payload: tared.
        rotation: orientation of frame 7 in the tare, shape (3, 3).
        known: what the sensor shows without any load [N, N m], shape (6,).
    """
    expected = payload.sign * payload.weight(rotation)[:3]
    seen = expected + (payload.bias - known)[:3]
    return compare_weights(expected[None, :], seen[None, :])
