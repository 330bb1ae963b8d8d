"""Bed of stones: an uneven surface with slip sinkage, and its jams."""

import math

import numpy as np

from fakes.ground.contact import DAMPING_MASS, NO_CONTACT, Contact, Motion
from fakes.ground.footing import Footing
from fakes.ground.jams import JamSequence
from fakes.ground.profile import GRID, smooth_profile, value_at
from fakes.ground.stone_sizes import StoneParameters, slope_factor

_S_H, _L_H = 0.07, 0.40  # height of the surface and its correlation length [d50]
_L_S = 0.06  # slip length of the sinkage [m]
_FIRM = 5.0  # normal force of full sinkage [N]
_STEEPEST_SLOPE = 0.5  # limit of the slope under a foot
_MU_LATERAL = 0.6
# A foot lifted for this long and set down this far away meets fresh stones; a bounce or
# hop during a push (up to 0.7 s and 1.4 d50 in a trial) does not.
_LIFTED, _AWAY = 1.0, 3.0  # s, d50


class StoneBed:
    """Bed of stones under one foot in one trial.

    A foot that is lifted and set down elsewhere meets fresh stones: a new jam and no
    slip sinkage.

    Attributes:
        sink: slip sinkage [m].
        away: distance from the last stand at which the stones are fresh [m].
    """

    def __init__(
        self, parameters: StoneParameters, incline: float, rng: np.random.Generator
    ) -> None:
        """Draw the bed of one trial.

        Args:
            parameters: parameters of the stones.
            incline: incline of the container [rad].
            rng: generator of this trial's ground.
        """
        p = parameters
        self._parameters = p
        self._bed = math.exp(0.12 * float(rng.standard_normal()))
        self._k_n = p.k_n
        self._c_n = 2.0 * p.zeta * math.sqrt(p.k_n * DAMPING_MASS)
        profile = _S_H * p.d50 * smooth_profile(rng, _L_H * p.d50)
        self._slope = np.gradient(profile, GRID).tolist()
        self._profile = profile.tolist()
        self.sink = 0.0
        self._sink_limit = p.s_inf * p.d50
        self._aloft = 0.0  # time of the foot in the air [s]
        self.away = _AWAY * p.d50
        self._stood_at: float | None = None  # last position in contact [m]
        self._footing = Footing(p.K_t, p.cop, 0.5 * p.d50, rng)
        self._jams = JamSequence(p, p.J0 * slope_factor(incline) * self._bed, rng)

    @property
    def stiffness(self) -> float:
        """Normal stiffness [N/m]."""
        return self._parameters.k_n

    @property
    def releases(self) -> int:
        """Number of collapsed jams."""
        return self._jams.releases

    def surface(self, x: float) -> float:
        """Return the height of the undisturbed bed at `x` [m]."""
        return value_at(self._profile, x)

    def _is_away(self, x: float) -> bool:
        """Return whether `x` is far from the last stand: the stones are fresh there."""
        return self._stood_at is not None and abs(x - self._stood_at) >= self.away

    def truth(self) -> dict[str, float]:
        """Return the true parameters [SI]."""
        return {
            "bed_factor": self._bed,
            "J0": self._parameters.J0,
            "d50": self._parameters.d50,
            "releases": float(self.releases),
        }

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the bed by `dt` [s] and return its wrench on the foot."""
        x, _, z, vx, _, vz, _, _, _ = motion
        is_fresh = self._aloft >= _LIFTED and self._is_away(x)
        sink = 0.0 if is_fresh else self.sink
        depth = value_at(self._profile, x) - sink - z
        if depth <= 0.0:
            self._aloft += dt
            self._footing.release()
            self._jams.lose_contact()
            return NO_CONTACT
        if is_fresh:
            self.sink = 0.0
            self._jams.begin_at(x)
        self._aloft = 0.0
        self._stood_at = x
        slope = value_at(self._slope, x)
        F_n = self._k_n * depth + self._c_n * (slope * vx - vz)
        F_n = max(F_n, 0.0)
        sunk = sink / self._sink_limit
        if vx > 0.0:
            rate = vx * (self._sink_limit - sink) / _L_S
            self.sink = sink + dt * rate * min(F_n / _FIRM, 1.0)
        F_t = self._jams.step(dt, x, vx, F_n, sunk)
        if not -_STEEPEST_SLOPE <= slope <= _STEEPEST_SLOPE:
            slope = math.copysign(_STEEPEST_SLOPE, slope)
        F_t += F_n * slope
        return self._footing.step(dt, motion, F_t, F_n, _MU_LATERAL)
