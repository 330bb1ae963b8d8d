"""Stances on the simulated ground alone: two masses on it, no arm.

The ground and the law of the sole are those of a session; two masses and a little drag
stand in for the arm. Forces are those of the ground, without a sensor's errors.
"""

from typing import Final

from acquisition.control_loop.law import SoleGoal
from fakes.ground.terrain import GroundChoice, Terrain, make_terrain
from fakes.randomness import trial_generators
from wam.control.sole_impedance import SoleAxes

SUBSTEPS, DT = 4, 0.0005
PERIOD: Final = SUBSTEPS * DT
TICK_CYCLES: Final = 10  # cycles of 20 ms
MASS_X, MASS_Z = 4.0, 3.5  # the arm's inertia at the foot, with the forearm [kg]
COULOMB, VISCOUS = 0.5, 2.0  # joint drag seen at the foot: N, N s/m
_CARRIED, _ALOFT = 0.014, 2.0  # m, s, as the arm takes


class StanceBed:
    """One bed under a foot that nothing but the law of the sole moves.

    Attributes:
        x, z: place of the sole [m], z from the plane upwards.
        F_t, F_n: force of the ground on it, mean of the last 2 ms [N].
        cycles: of 2 ms since the beginning.
    """

    def __init__(
        self,
        terrain: str,
        choice: GroundChoice,
        incline: float,
        travel: float,
        number: tuple[int, int],
    ) -> None:
        """Make a bed.

        Args:
            terrain: its name.
            choice: what the ground is.
            incline: along the push, positive downhill [rad].
            travel: length of the container [m].
            number: seed, and trial of that seed.
        """
        random = trial_generators(number[0], terrain, number[1])
        self.ground: Terrain = make_terrain(choice, incline, random.ground)
        self.axes = SoleAxes(travel, PERIOD)
        self.x = self.vx = self.vz = 0.0
        self.z = 0.02
        self.F_t = self.F_n = 0.0
        self.cycles = 0
        self.axes.begin(self.x, self.z, 0)

    @property
    def now_ns(self) -> int:
        """Time since the beginning [ns]."""
        return round(self.cycles * PERIOD * 1e9)

    @property
    def capacity(self) -> float:
        """Traction at which the foot slips here under its load now [N]."""
        return self.ground.capacity(self.x, self.F_n)

    def cycle(self) -> None:
        """Advance by 2 ms."""
        position, speed = (self.x, self.z), (self.vx, self.vz)
        f_x, f_z = self.axes.force(position, speed, self.now_ns)
        F_t = F_n = 0.0
        for _ in range(SUBSTEPS):
            vx, vz = self.vx, self.vz
            motion = (self.x, 0.0, self.z, vx, 0.0, vz, 0.0, 0.0, 0.0)
            t, _, n, *_ = self.ground.step(DT, motion)
            F_t, F_n = F_t + t, F_n + n
            slow_x = 1.0 if vx > 0.01 else -1.0 if vx < -0.01 else 100.0 * vx
            slow_z = 1.0 if vz > 0.01 else -1.0 if vz < -0.01 else 100.0 * vz
            drag_x = COULOMB * slow_x + VISCOUS * vx
            drag_z = COULOMB * slow_z + VISCOUS * vz
            self.vx += DT * (f_x - t - drag_x) / MASS_X
            self.vz += DT * (f_z + n - drag_z) / MASS_Z
            self.x += DT * self.vx
            self.z += DT * self.vz
        self.F_t, self.F_n = F_t / SUBSTEPS, F_n / SUBSTEPS
        self.cycles += 1

    def advance(self) -> None:
        """Advance by 20 ms."""
        for _ in range(TICK_CYCLES):
            self.cycle()

    def carry(self, x: float) -> None:
        """Be carried through the air to `x`: nothing happens there."""
        self.x, self.z, self.vx, self.vz = x, _CARRIED, 0.0, 0.0
        self.ground.step(_ALOFT, (x, 0.0, _CARRIED, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        self.axes.begin(x, self.z, self.now_ns)

    def aim(self, goal: SoleGoal) -> None:
        """Take what the sole is to do from now on."""
        self.axes.aim(goal, self.x, self.z, self.now_ns)
