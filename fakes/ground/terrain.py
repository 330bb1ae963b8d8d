"""Ground of one trial: a plate or a bed of stones, between the container's planks."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Protocol, TypeVar

import numpy as np

from fakes.ground.contact import DAMPING_MASS, NO_CONTACT, Contact, Motion
from fakes.ground.footing import Footing
from fakes.ground.profile import smooth_profile, value_at
from fakes.ground.stone_sizes import (
    STONES,
    StoneParameters,
    not_simulated,
    stones_of_size,
)
from fakes.ground.stones import StoneBed


@dataclass(frozen=True, slots=True)
class PlateParameters:
    """LuGre friction of a flat plate, for a pair of surface and tread."""

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
_COP_SPREAD, _COP_LENGTH = 0.003, 0.010  # centre of pressure [m]


class Plate:
    """A flat plate with LuGre friction per newton of normal force."""

    def __init__(self, parameters: PlateParameters, rng: np.random.Generator) -> None:
        self._parameters = parameters
        self._bristle = 0.0  # deflection [m]
        self._pressed = 0.0  # normal force of the last step [N]
        self._c_n = 2.0 * parameters.zeta * math.sqrt(parameters.k_n * DAMPING_MASS)
        # Factors of the friction: of this trial, and along the plate.
        self._level = math.exp(0.02 * float(rng.standard_normal()))
        self._texture = (1.0 + 0.03 * smooth_profile(rng, 0.03)).tolist()
        self._footing = Footing(_K_LATERAL, _COP_SPREAD, _COP_LENGTH, rng)

    @property
    def stiffness(self) -> float:
        """Normal stiffness [N/m]."""
        return self._parameters.k_n

    def surface(self, x: float) -> float:
        """Return 0: a plate is flat."""
        del x
        return 0.0

    def truth(self) -> dict[str, float]:
        """Return the true parameters [SI]."""
        return {
            "mu_s": self._parameters.mu_s * self._level,
            "mu_k": self._parameters.mu_k * self._level,
            "v_S": self._parameters.v_S,
            "b": self._parameters.b,
        }

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the bristle by `dt` [s] and return the wrench on the foot."""
        p = self._parameters
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
            # A higher normal force stiffens the bristle. Keep its force, not its
            # deflection: otherwise pressing would create energy.
            before *= self._pressed / F_n
        self._pressed = F_n
        # backward Euler in z: the equation is stiff at high speed
        bristle = (before + dt * v) / (1.0 + dt * p.s0 * abs(v) / g)
        limit = p.mu_s * m / p.s0
        self._bristle = bristle = min(max(bristle, -limit), limit)
        rate = (bristle - before) / dt
        F_t = F_n * (p.s0 * bristle + p.s1 * rate) + p.b * v * min(1.0, F_n)
        return self._footing.step(dt, motion, F_t, F_n, p.mu_k)


class Terrain(Protocol):
    """Interface of a ground."""

    @property
    def stiffness(self) -> float:
        """Normal stiffness [N/m]."""
        ...

    def surface(self, x: float) -> float:
        """Return the height of the undisturbed ground at `x` [m]."""
        ...

    def truth(self) -> dict[str, float]:
        """Return the true parameters [SI]."""
        ...

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the contact by `dt` [s] and return its wrench on the foot."""
        ...


@dataclass(frozen=True, slots=True)
class GroundChoice:
    """Ground of a container.

    Attributes:
        stones: "small", "big", "none" (a plate), or e.g. "12 mm".
        foot: name of the foot, for plates.
        sole: friction of the foot on plates; None = by its name, default "tread".
        effects: factors of parameters by name; unknown ones are ignored.
    """

    stones: str
    foot: str
    sole: PlateParameters | None = None
    effects: Mapping[str, float] = field(default_factory=dict[str, float])

    def plate(self) -> PlateParameters:
        """Return the friction of the foot on a plate."""
        parameters = self.sole or PLATES.get(self.foot, PLATES["tread"])
        return _multiplied(parameters, self.effects)

    def bed(self) -> StoneParameters:
        """Return the parameters of the stones.

        Raises:
            SettingsError: stones of this kind are not simulated.
        """
        return _multiplied(_stones(self.stones), self.effects)


def _stones(word: str) -> StoneParameters:
    if word in STONES:
        return STONES[word]
    size, _, unit = word.partition(" ")
    if unit != "mm":
        raise not_simulated(f"{word!r} without a grain size")
    return stones_of_size(1e-3 * float(size))


_P = TypeVar("_P", PlateParameters, StoneParameters)


def _multiplied(parameters: _P, effects: Mapping[str, float]) -> _P:
    """Return the parameters multiplied by the effects of the same name."""
    own = {f.name for f in fields(parameters)} & set(effects)
    return replace(
        parameters, **{name: effects[name] * getattr(parameters, name) for name in own}
    )


def make_terrain(
    choice: GroundChoice, incline: float, rng: np.random.Generator
) -> Plate | StoneBed:
    """Return the ground of one trial.

    Args:
        choice: kind of ground.
        incline: incline along the push, positive downhill [rad].
        rng: generator of this trial.

    Raises:
        SettingsError: this ground is not simulated.
    """
    if choice.stones == "none":
        return Plate(choice.plate(), rng)
    return StoneBed(choice.bed(), incline, rng)


FREE = 0.045  # lateral travel from the centre line to a plank [m]
_RIM = 0.04  # height of the planks above the plane [m]
_PLANK_K = 5000.0  # N/m
_PLANK_B = 2.0 * 0.4 * math.sqrt(_PLANK_K * DAMPING_MASS)  # N s/m
_PLANK_MU = 0.3  # friction along the planks


class Container:
    """A ground between two planks with unilateral contact."""

    def __init__(self, ground: Terrain) -> None:
        self.ground = ground

    @property
    def stiffness(self) -> float:
        """Normal stiffness of the ground [N/m]."""
        return self.ground.stiffness

    def surface(self, x: float) -> float:
        """Return the height of the undisturbed ground at `x` [m]."""
        return self.ground.surface(x)

    def truth(self) -> dict[str, float]:
        """Return the true parameters [SI]."""
        return self.ground.truth()

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the ground by `dt` [s]; return the wrench of ground and planks."""
        contact = self.ground.step(dt, motion)
        if -FREE <= motion[1] <= FREE:
            return contact
        _, y, z, vx, vy, _, _, _, _ = motion
        if z > _RIM:
            return contact
        depth = abs(y) - FREE
        side = math.copysign(1.0, y)
        plank_force = max(0.0, _PLANK_K * depth + _PLANK_B * side * vy)
        friction = _PLANK_MU * plank_force * math.tanh(vx / 0.01)
        F_t, F_y, F_n, M_x, M_y, M_z = contact
        return F_t + friction, F_y - side * plank_force, F_n, M_x, M_y, M_z
