"""A bed of stones: an uneven surface that sinks under the foot, and its jams."""

import math

import numpy as np

from fakes.ground.contact import DAMPING_MASS, NO_CONTACT, Contact, Motion
from fakes.ground.footing import Footing
from fakes.ground.jams import JamSequence
from fakes.ground.profile import GRID, locate, smooth_profile, value_at
from fakes.ground.stone_sizes import StoneParameters, slope_factor

_S_H, _L_H = 0.07, 0.40  # height of the surface and its correlation length [d50]
L_S = 0.06  # slip over which the bed sinks [m]
FIRM = 5.0  # normal force from which it sinks fully [N]
STEEPEST_SLOPE = 0.5  # slope that a foot can feel
MU_LATERAL = 0.6
# A foot that was in the air for this long and comes down this far away stands anew; a
# bounce or a hop of the pushed foot (up to 0.7 s and 1.4 d50 in a trial) does not.
LIFTED, _AWAY = 1.0, 3.0  # s, d50


class StoneBed:
    """A bed of stones as one foot meets it in one trial.

    A foot that is lifted and set down elsewhere stands on stones that nothing has
    pushed or pressed yet: a jam of its own, and no slip sinkage.

    Attributes:
        parameters: of the stones.
        k_n, c_n: stiffness [N/m] and damping [N s/m] of the bed.
        profile, slope: height of the surface [m] and its slope, on the grid.
        sink: slip sinkage [m]; at most `sink_limit`.
        aloft: since when the foot has been in the air [s].
        stood_at: where it stood last [m]; None = nowhere yet.
        away: a foot that comes down this far from there stands anew [m].
        footing, jams: what the sole's size adds, and the stones under it.
    """

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
        self.parameters = p
        self._bed = math.exp(0.12 * float(rng.standard_normal()))
        self.k_n = p.k_n
        self.c_n = 2.0 * p.zeta * math.sqrt(p.k_n * DAMPING_MASS)
        profile = _S_H * p.d50 * smooth_profile(rng, _L_H * p.d50)
        self.slope = np.gradient(profile, GRID).tolist()
        self.profile = profile.tolist()
        self.sink = 0.0
        self.sink_limit = p.s_inf * p.d50
        self.aloft = 0.0
        self.away = _AWAY * p.d50
        self.stood_at: float | None = None
        self.footing = Footing(p.K_t, p.cop, 0.5 * p.d50, rng)
        self.jams = JamSequence(p, p.J0 * slope_factor(incline) * self._bed, rng)

    @property
    def stiffness(self) -> float:
        """Normal stiffness [N/m]."""
        return self.parameters.k_n

    @property
    def releases(self) -> int:
        """How many jams have let go."""
        return self.jams.releases

    def surface(self, x: float) -> float:
        """Return the height of the undisturbed bed at `x` [m]."""
        return value_at(self.profile, x)

    def capacity(self, x: float, F_n: float) -> float:
        """Return the traction that the foot at `x` [m] can be given now [N]."""
        del x
        return self.jams.capacity_at(F_n)

    def _is_away(self, x: float) -> bool:
        """Whether a lifted foot is far from where it stood: the bed is fresh there."""
        return self.stood_at is not None and abs(x - self.stood_at) >= self.away

    def truth(self) -> dict[str, float]:
        """Return the parameters in force [SI]."""
        return {
            "bed_factor": self._bed,
            "J0": self.parameters.J0,
            "d50": self.parameters.d50,
            "releases": float(self.releases),
        }

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the bed by `dt` [s] and return what it does to the foot."""
        x, _, z, vx, _, vz, _, _, _ = motion
        is_fresh = self.aloft >= LIFTED and self._is_away(x)
        sink = 0.0 if is_fresh else self.sink
        row, share = locate(x)
        h, s = self.profile, self.slope
        depth = h[row] + share * (h[row + 1] - h[row]) - sink - z
        if depth <= 0.0:
            self.aloft += dt
            self.footing.release()
            self.jams.lose_contact()
            return NO_CONTACT
        if is_fresh:
            self.sink = 0.0
            self.jams.begin_at(x)
        self.aloft = 0.0
        self.stood_at = x
        slope = s[row] + share * (s[row + 1] - s[row])
        F_n = self.k_n * depth + self.c_n * (slope * vx - vz)
        F_n = F_n if F_n > 0.0 else 0.0
        sunk = sink / self.sink_limit
        if vx > 0.0:
            rate = vx * (self.sink_limit - sink) / L_S
            self.sink = sink + dt * rate * (F_n / FIRM if F_n < FIRM else 1.0)
        F_t = self.jams.step(dt, (x, vx), F_n, sunk)
        if not -STEEPEST_SLOPE <= slope <= STEEPEST_SLOPE:
            slope = math.copysign(STEEPEST_SLOPE, slope)
        F_t += F_n * slope
        return self.footing.step(dt, motion, F_t, F_n, MU_LATERAL)
