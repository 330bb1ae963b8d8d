"""What a terrain database answers: traction and risk, and whether it was measured."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.data import Array


@dataclass(frozen=True, slots=True)
class TractionEstimate:
    """What is to be expected of a terrain at one point.

    Attributes:
        mean: traction [N].
        sd: its standard deviation [N], noise included.
        is_extrapolated: the point lies outside the table: the values are of its edge.
    """

    mean: float
    sd: float
    is_extrapolated: bool = False

    def quantile(self, share: float) -> float:
        """Return the traction [N] that is not reached with probability `share`."""
        from scipy.special import ndtri

        return self.mean + self.sd * float(ndtri(share))


@dataclass(frozen=True, slots=True)
class TractionEstimates:
    """What is to be expected of a terrain at many points, arrays of shape (n,).

    Attributes:
        mean: traction [N].
        sd: its standard deviation [N], noise included.
        is_extrapolated: which points lie outside the table.
    """

    mean: Array
    sd: Array
    is_extrapolated: NDArray[np.bool_]


class SlipRisk(float):
    """A probability of slipping, a number that knows where it comes from.

    Attributes:
        is_extrapolated: the point lies outside the table: the risk is that of its edge,
            and nobody has measured it.
    """

    __slots__ = ("is_extrapolated",)
    is_extrapolated: bool

    def __new__(cls, probability: float, *, is_extrapolated: bool) -> "SlipRisk":
        """Return the risk `probability` (0 to 1)."""
        risk = super().__new__(cls, probability)
        risk.is_extrapolated = is_extrapolated
        return risk
