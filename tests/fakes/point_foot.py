"""A point on springs instead of an arm, to test terrain and hand alone.

Two masses and a little drag replace the arm, and a simulated sensor the wrist's.
"""

import math

import numpy as np

from analysis.data.prepare import foot_velocity
from analysis.data.series import TractionSeries
from fakes.ground.profile import smooth_profile, value_at
from fakes.ground.terrain import GroundChoice, Terrain, make_terrain
from fakes.plant.push import HandView, Pace, Push
from fakes.randomness import trial_generators
from fakes.sensor.errors import FORCE_ERRORS, SensorErrors

SUBSTEPS, DT = 4, 0.0005
PERIOD = SUBSTEPS * DT
MASS_X, MASS_Z = 4.0, 3.5  # the arm's inertia at the foot, with the forearm [kg]
COULOMB, VISCOUS = 0.5, 2.0  # joint drag seen at the foot: N, N s/m
GROUNDS = {
    "S0": ("small", "tread", 0.0),
    "S10": ("small", "tread", 10.0),
    "S15": ("small", "tread", 15.0),
    "B0": ("big", "tread", 0.0),
    "B10": ("big", "tread", 10.0),
    "B15": ("big", "tread", 15.0),
    "TF": ("none", "tread", 0.0),
    "Tf": ("none", "bare", 0.0),
}
CYCLES = round(1.0 / PERIOD)  # in a second
RESIDUAL, RESIDUAL_LENGTH = 0.15, 0.12  # of gravity compensation: N rms, m
EFFECTIVE_MASS, TOOL_MASS = 0.30, 0.45  # kg
TRAVEL, REST_AFTER, LONGEST = 0.45, 0.4, 30.0  # m, s, s
STEP = 50e-6  # counts of seven motors together, seen at the foot [m]


class PointFoot:
    """The state of one trial."""

    def __init__(
        self,
        terrain: str,
        seed: int,
        trial: int,
        pace: Pace | None = None,
        kind: tuple[str, str, float] | None = None,
    ) -> None:
        stones, foot, incline_deg = kind or GROUNDS[terrain]
        random = trial_generators(seed, terrain, trial)
        incline = math.radians(incline_deg)
        self.terrain, self.trial = terrain, trial
        choice = GroundChoice(stones, foot)
        self.ground: Terrain = make_terrain(choice, incline, random.ground)
        weight = EFFECTIVE_MASS * 9.81
        self.pull = weight * math.sin(incline)
        self.weight = weight * math.cos(incline)
        self.residual = [
            (RESIDUAL * smooth_profile(random.sensor, RESIDUAL_LENGTH)).tolist()
            for _ in range(2)
        ]
        self.errors = SensorErrors(random.sensor, FORCE_ERRORS)
        self.tare = self._take_tare()
        self.x = self.vx = self.vz = 0.0
        self.z = self.ground.surface(0.0) - self.weight / self.ground.stiffness
        self.push = Push(pace or Pace(), random.hand, self.view(), DT)
        self.rows: list[tuple[float, float, float]] = []

    def view(self) -> HandView:
        at, speed = (self.x, 0.0, self.z), (self.vx, 0.0, self.vz)
        return HandView(at, speed, at, speed)

    def substep(self) -> tuple[float, float]:
        """Advance by half a millisecond and return (F_t, F_n)."""
        along, _, upward = self.push.step(self.view())
        motion = (self.x, 0.0, self.z, self.vx, 0.0, self.vz, 0.0, 0.0, 0.0)
        F_t, _, F_n, *_ = self.ground.step(DT, motion)
        drag_x = COULOMB * math.tanh(self.vx / 0.01) + VISCOUS * self.vx
        drag_z = COULOMB * math.tanh(self.vz / 0.01) + VISCOUS * self.vz
        left_x, left_z = (value_at(table, self.x) for table in self.residual)
        force_x = along + self.pull + left_x - F_t - drag_x
        force_z = upward - self.weight + left_z + F_n - drag_z
        self.vx += DT * force_x / MASS_X
        self.vz += DT * force_z / MASS_Z
        self.x += DT * self.vx
        self.z += DT * self.vz
        return F_t, F_n

    def cycle(self) -> None:
        """Advance by 2 ms and record the readings of encoders and sensor."""
        before = self.vx, self.vz
        forces = [self.substep() for _ in range(SUBSTEPS)]
        F_t, F_n = (sum(column) / SUBSTEPS for column in zip(*forces, strict=True))
        ax, az = (self.vx - before[0]) / PERIOD, (self.vz - before[1]) / PERIOD
        felt = (F_t + TOOL_MASS * ax, 0.0, F_n - TOOL_MASS * az, 0.0, 0.0, 0.0)
        shown = self.errors.apply(self._t_ns(len(self.rows)), felt)
        F_t, _, F_n = np.array(shown[:3]) - self.tare
        self.rows.append((math.floor(self.x / STEP) * STEP, F_t, F_n))

    def _take_tare(self) -> np.ndarray:
        """Return the force that the sensor shows in the second before the last."""
        before = range(-2 * CYCLES, -CYCLES)
        shown = [self.errors.apply(self._t_ns(k), (0.0,) * 6)[:3] for k in before]
        return np.mean(shown, axis=0)

    @staticmethod
    def _t_ns(row: int) -> int:
        return row * round(PERIOD * 1e9)

    def run(self) -> TractionSeries:
        """Push across the container and return the recorded series."""
        arrived = 0.0
        while arrived < REST_AFTER and len(self.rows) * PERIOD < LONGEST:
            self.cycle()
            arrived += PERIOD if self.x >= TRAVEL else 0.0
        x, F_t, F_n = np.array(self.rows).T
        t = PERIOD * np.arange(x.size)
        name = f"{self.terrain}-{self.trial}"
        return TractionSeries(self.terrain, name, t, foot_velocity(t, x), F_n, F_t)
