"""Flat plates: LuGre friction per newton of normal force."""

import math
from dataclasses import dataclass

import numpy as np

from fakes.ground.contact import DAMPING_MASS, NO_CONTACT, Contact, Motion
from fakes.ground.footing import Footing
from fakes.ground.profile import smooth_profile, value_at


@dataclass(frozen=True, slots=True)
class PlateParameters:
    """LuGre friction of a flat plate: the surface and the foot's tread."""

    mu_s: float
    mu_k: float
    v_S: float
    b: float
    s0: float = 1500.0
    s1: float = 4.0
    k_n: float = 12000.0
    zeta: float = 0.4


PLATES = {
    "tread": PlateParameters(mu_s=0.88, mu_k=0.76, v_S=0.02, b=5.0),
    "bare": PlateParameters(mu_s=0.36, mu_k=0.32, v_S=0.02, b=0.3),
}


_K_LATERAL = 2200.0  # N/m
_COP_SPREAD, _COP_LENGTH = 0.003, 0.010  # of the centre of pressure [m]


class Plate:
    """A flat plate with LuGre friction per newton of normal force."""

    def __init__(self, parameters: PlateParameters, rng: np.random.Generator) -> None:
        self._p = parameters
        self._bristle = 0.0
        self._pressed = 0.0
        self._c_n = 2.0 * parameters.zeta * math.sqrt(parameters.k_n * DAMPING_MASS)
        self._level = math.exp(0.02 * float(rng.standard_normal()))
        self._texture = (1.0 + 0.03 * smooth_profile(rng, 0.03)).tolist()
        self._footing = Footing(_K_LATERAL, _COP_SPREAD, _COP_LENGTH, rng)

    @property
    def stiffness(self) -> float:
        """Normal stiffness [N/m]."""
        return self._p.k_n

    def surface(self, x: float) -> float:
        """Return 0: a plate is flat."""
        del x
        return 0.0

    def truth(self) -> dict[str, float]:
        """Return the parameters in force [SI]."""
        return {
            "mu_s": self._p.mu_s * self._level,
            "mu_k": self._p.mu_k * self._level,
            "v_S": self._p.v_S,
            "b": self._p.b,
        }

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the bristle by `dt` and return the force."""
        p = self._p
        x, _, z, v, _, vz, _, _, _ = motion
        if z >= 0.0:
            self._bristle = self._pressed = 0.0
            self._footing.release()
            return NO_CONTACT
        F_n = max(0.0, -p.k_n * z - self._c_n * vz)
        m = self._level * value_at(self._texture, x)
        g = (p.mu_k + (p.mu_s - p.mu_k) * math.exp(-((v / p.v_S) ** 2))) * m
        before = self._bristle
        if F_n > self._pressed:
            # Pressing harder stiffens the bristle; its force stays, or the stretch of a
            # light touch would be paid back with the energy of a heavy one.
            before *= self._pressed / F_n
        self._pressed = F_n
        # backward Euler in z: the bristle is stiff at high speed
        bristle = (before + dt * v) / (1.0 + dt * p.s0 * abs(v) / g)
        limit = p.mu_s * m / p.s0
        self._bristle = bristle = min(max(bristle, -limit), limit)
        rate = (bristle - before) / dt
        F_t = F_n * (p.s0 * bristle + p.s1 * rate) + p.b * v * min(1.0, F_n)
        return self._footing.step(dt, motion, F_t, F_n, p.mu_k)
