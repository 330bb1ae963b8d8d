"""Lateral friction and moments of a sole of finite size.

The centre of pressure wanders under the sole along the path; bristles with a slip limit
resist lateral motion, turning and tilting.
"""

import numpy as np

from fakes.ground.contact import Contact, Motion
from fakes.ground.profile import smooth_profile, value_at

_K_TURN = 10.0  # N m/rad, about each axis
_ARM = 0.03  # torsional friction limit per newton of normal force [m]
_TURN_PER_N = _ARM / _K_TURN  # stretch of a torsional bristle at its limit [rad/N]


class Footing:
    """Lateral bristle, torsional bristles and the wandering centre of pressure.

    A bristle is stretched by the motion of the sole up to its slip limit. A change of
    the limit never increases the stored energy.
    """

    def __init__(
        self, stiffness: float, spread: float, length: float, rng: np.random.Generator
    ) -> None:
        """Draw one trial's footing.

        Args:
            stiffness: stiffness of the lateral bristle [N/m].
            spread: spread of the centre of pressure about the sole's centre [m rms].
            length: correlation length of its path [m].
            rng: generator of this trial's ground.
        """
        self._cop_x = (spread * smooth_profile(rng, length)).tolist()
        self._cop_y = (spread * smooth_profile(rng, length)).tolist()
        self._stiffness = stiffness
        self.release()

    def release(self) -> None:
        """Reset after loss of contact."""
        self._aside = 0.0  # stretch of the lateral bristle [m]
        self._turn_x = self._turn_y = self._turn_z = 0.0  # torsional bristles [rad]

    def centre_of_pressure(self, x: float) -> tuple[float, float]:
        """Return the offset from the sole's centre with the sole at `x` [m]."""
        return value_at(self._cop_x, x), value_at(self._cop_y, x)

    def step(
        self, dt: float, motion: Motion, F_t: float, F_n: float, mu: float
    ) -> Contact:
        """Advance the bristles; return the wrench from F_t, F_n and the bristles.

        Args:
            dt: time step [s].
            motion: motion of the sole.
            F_t: traction [N].
            F_n: normal force [N].
            mu: lateral friction limit per newton of F_n.
        """
        if F_n <= 0.0:
            self.release()
            return F_t, 0.0, 0.0, 0.0, 0.0, 0.0
        at, _, _, _, vy, _, wx, wy, wz = motion
        x, y = self.centre_of_pressure(at)
        k, limit = self._stiffness, _TURN_PER_N * F_n
        self._aside = _slipped(self._aside + vy * dt, mu * F_n / k)
        self._turn_x = _slipped(self._turn_x + wx * dt, limit)
        self._turn_y = _slipped(self._turn_y + wy * dt, limit)
        self._turn_z = _slipped(self._turn_z + wz * dt, limit)
        F_y = -k * self._aside
        return (
            F_t,
            F_y,
            F_n,
            y * F_n - _K_TURN * self._turn_x,
            -x * F_n - _K_TURN * self._turn_y,
            x * F_y + y * F_t - _K_TURN * self._turn_z,
        )


def _slipped(stretch: float, limit: float) -> float:
    """Return `stretch` clipped to ±`limit`."""
    return limit if stretch > limit else -limit if stretch < -limit else stretch
