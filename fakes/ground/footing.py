"""What a sole of finite size adds to a point: sideways hold, and moments.

The centre of pressure wanders under the sole as the stones change; the sole resists
being shifted sideways, turned and tilted like bristles that slip at a limit.
"""

import numpy as np

from fakes.ground.contact import Contact, Motion
from fakes.ground.profile import locate, smooth_profile

K_TURN = 10.0  # N m/rad, about each axis
_ARM = 0.03  # torsional friction limit per newton of normal force [m]
TURN_PER_N = _ARM / K_TURN  # stretch of a torsional bristle at its limit [rad/N]


class Footing:
    """Lateral bristle, torsional bristles and the wandering centre of pressure.

    A bristle is stretched by what the sole moves, up to a limit at which it slips. The
    limit may be another at every step; the stored energy never grows by a change of it.

    Attributes:
        cop_x, cop_y: offset of the centre of pressure on the grid [m].
        stiffness: of the lateral bristle [N/m].
        aside: its stretch [m].
        turn_x, turn_y, turn_z: of the torsional bristles [rad].
    """

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
        self.cop_x = (spread * smooth_profile(rng, length)).tolist()
        self.cop_y = (spread * smooth_profile(rng, length)).tolist()
        self.stiffness = stiffness
        self.release()

    def release(self) -> None:
        """Lose contact."""
        self.aside = self.turn_x = self.turn_y = self.turn_z = 0.0

    def centre_of_pressure(self, x: float) -> tuple[float, float]:
        """Return its offset from the sole's centre with the sole at `x` [m]."""
        row, share = locate(x)
        a, b = self.cop_x, self.cop_y
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
            return F_t, 0.0, 0.0, 0.0, 0.0, 0.0
        at, _, _, _, vy, _, wx, wy, wz = motion
        x, y = self.centre_of_pressure(at)
        k, most = self.stiffness, TURN_PER_N * F_n
        # Written out four times: as a function it takes a third of this method's time.
        s, limit = self.aside + vy * dt, mu * F_n / k
        self.aside = limit if s > limit else -limit if s < -limit else s
        s = self.turn_x + wx * dt
        self.turn_x = turn_x = most if s > most else -most if s < -most else s
        s = self.turn_y + wy * dt
        self.turn_y = turn_y = most if s > most else -most if s < -most else s
        s = self.turn_z + wz * dt
        self.turn_z = turn_z = most if s > most else -most if s < -most else s
        F_y = -k * self.aside
        return (
            F_t,
            F_y,
            F_n,
            y * F_n - K_TURN * turn_x,
            -x * F_n - K_TURN * turn_y,
            x * F_y + y * F_t - K_TURN * turn_z,
        )
