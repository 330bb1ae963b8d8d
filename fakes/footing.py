"""What a sole of finite size adds to a point: sideways hold, and moments.

The centre of pressure wanders under the sole as the stones change; the sole resists
being shifted sideways, turned and tilted like bristles that slip at a limit.
"""

import numpy as np

from fakes.contact import Contact, Motion
from fakes.profile import locate, smooth_profile

_K_TURN = 10.0  # N m/rad, about each axis
_ARM = 0.03  # torsional friction limit per newton of normal force [m]


class Bristle:
    """Elastic-plastic bristle: stiffness in the unit asked for, a limit at each step.

    Its stored energy never grows by a change of the limit.
    """

    def __init__(self, stiffness: float) -> None:
        self._stiffness = stiffness
        self._stretch = 0.0

    def release(self) -> None:
        """Lose contact."""
        self._stretch = 0.0

    def step(self, moved: float, limit: float) -> float:
        """Return the force against a displacement of `moved` since the last step."""
        stretch = self._stretch + moved
        most = limit / self._stiffness
        if stretch > most:
            stretch = most
        elif stretch < -most:
            stretch = -most
        self._stretch = stretch
        return -self._stiffness * stretch


class Footing:
    """Lateral bristle, torsional bristles and the wandering centre of pressure."""

    def __init__(
        self, stiffness: float, spread: float, length: float, rng: np.random.Generator
    ) -> None:
        """Draw one trial's footing.

        Args:
            stiffness: of the lateral bristle [N/m].
            spread: of the centre of pressure about the sole's centre [m rms].
            length: over which it wanders [m].
            rng: of this trial's ground.
        """
        self._cop_x = (spread * smooth_profile(rng, length)).tolist()
        self._cop_y = (spread * smooth_profile(rng, length)).tolist()
        self._lateral = Bristle(stiffness)
        self._turns = tuple(Bristle(_K_TURN) for _ in range(3))

    def release(self) -> None:
        """Lose contact."""
        self._lateral.release()
        for bristle in self._turns:
            bristle.release()

    def centre_of_pressure(self, x: float) -> tuple[float, float]:
        """Return its offset from the sole's centre with the sole at `x` [m]."""
        row, share = locate(x)
        a, b = self._cop_x, self._cop_y
        return (
            a[row] + share * (a[row + 1] - a[row]),
            b[row] + share * (b[row + 1] - b[row]),
        )

    def step(
        self, dt: float, motion: Motion, F_t: float, F_n: float, mu: float
    ) -> Contact:
        """Return F_t and F_n with all that the sole's size adds to them.

        Args:
            dt: time step [s].
            motion: of the sole.
            F_t: traction [N].
            F_n: normal force [N].
            mu: lateral friction limit per newton of F_n.
        """
        if F_n <= 0.0:
            self.release()
            return Contact(F_t, 0.0, 0.0)
        limit = _ARM * F_n
        turn_x, turn_y, turn_z = self._turns
        x, y = self.centre_of_pressure(motion.x)
        F_y = self._lateral.step(motion.vy * dt, mu * F_n)
        return Contact(
            F_t,
            F_y,
            F_n,
            y * F_n + turn_x.step(motion.wx * dt, limit),
            -x * F_n + turn_y.step(motion.wy * dt, limit),
            x * F_y + y * F_t + turn_z.step(motion.wz * dt, limit),
        )
