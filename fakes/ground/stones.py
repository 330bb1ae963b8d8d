"""Beds of stones: an uneven surface that sinks under the foot, and its jams."""

import math

import numpy as np

from fakes.ground.contact import DAMPING_MASS, NO_CONTACT, Contact, Motion
from fakes.ground.footing import Footing
from fakes.ground.jam import JamSequence
from fakes.ground.profile import GRID, locate, smooth_profile, value_at
from fakes.ground.stone_sizes import StoneParameters, slope_factor

_S_H, _L_H = 0.07, 0.40  # height of the surface and its correlation length [d50]
_L_S = 0.06  # slip over which the bed sinks [m]
_FIRM = 5.0  # normal force from which it sinks fully [N]
_STEEPEST = 0.5  # slope that a foot can feel
_MU_LATERAL = 0.6


class StoneBed:
    """A bed of stones as one foot meets it in one trial."""

    def __init__(
        self, parameters: StoneParameters, incline: float, rng: np.random.Generator
    ) -> None:
        """Lay the bed.

        Args:
            parameters: of the stones.
            incline: of the container [rad].
            rng: of this trial's ground; everything random is drawn from it.
        """
        p = parameters
        self._p = p
        self._bed = math.exp(0.12 * float(rng.standard_normal()))
        self._k_n = p.k_n
        self._c_n = 2.0 * p.zeta * math.sqrt(p.k_n * DAMPING_MASS)
        profile = _S_H * p.d50 * smooth_profile(rng, _L_H * p.d50)
        self._slope = np.gradient(profile, GRID).tolist()
        self._profile = profile.tolist()
        self._sink = 0.0
        self._sink_limit = p.s_inf * p.d50
        self._footing = Footing(p.K_t, p.cop, 0.5 * p.d50, rng)
        self._jams = JamSequence(p, p.J0 * slope_factor(incline) * self._bed, rng)

    @property
    def stiffness(self) -> float:
        """Normal stiffness [N/m]."""
        return self._p.k_n

    @property
    def releases(self) -> int:
        """How many jams have let go."""
        return self._jams.releases

    def surface(self, x: float) -> float:
        """Return the height of the undisturbed bed at `x` [m]."""
        return value_at(self._profile, x)

    def truth(self) -> dict[str, float]:
        """Return the parameters in force [SI]."""
        return {
            "bed_factor": self._bed,
            "J0": self._p.J0,
            "d50": self._p.d50,
            "releases": float(self.releases),
        }

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the bed by `dt` [s] and return what it does to the foot."""
        x, _, z, vx, _, vz, _, _, _ = motion
        sink = self._sink
        row, share = locate(x)
        h, s = self._profile, self._slope
        depth = h[row] + share * (h[row + 1] - h[row]) - sink - z
        if depth <= 0.0:
            self._footing.release()
            self._jams.lose_contact()
            return NO_CONTACT
        slope = s[row] + share * (s[row + 1] - s[row])
        F_n = self._k_n * depth + self._c_n * (slope * vx - vz)
        F_n = F_n if F_n > 0.0 else 0.0
        sunk = sink / self._sink_limit
        if vx > 0.0:
            rate = vx * (self._sink_limit - sink) / _L_S
            self._sink = sink + dt * rate * (F_n / _FIRM if F_n < _FIRM else 1.0)
        F_t = self._jams.step(dt, (x, vx), F_n, sunk)
        if not -_STEEPEST <= slope <= _STEEPEST:
            slope = math.copysign(_STEEPEST, slope)
        F_t += F_n * slope
        return self._footing.step(dt, motion, F_t, F_n, _MU_LATERAL)
