"""A ground whose traction is that of a law; all else is that of a simulated one."""

from typing import Protocol

from fakes.ground.contact import Contact, Motion
from fakes.ground.terrain import BesideGround, Terrain


class TractionLaw(Protocol):
    """Gives F_t of a foot step by step."""

    def step(self, dt: float, x: float, v: float, F_n: float) -> float:
        """Return F_t [N]."""
        ...

    def capacity(self, F_n: float) -> float:
        """Return the traction at which the foot slips [N]."""
        ...


class LawGround(BesideGround):
    """Normal force and surface of a ground, traction of a law."""

    def __init__(self, ground: Terrain, law: TractionLaw) -> None:
        super().__init__(ground)
        self.law = law

    def capacity(self, x: float, F_n: float) -> float:
        """Return the traction at which a foot slips now [N]."""
        del x
        return self.law.capacity(F_n)

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance by `dt` [s] and return what the ground does to the foot."""
        _, F_y, F_n, M_x, M_y, M_z = self.ground.step(dt, motion)
        F_t = self.law.step(dt, motion[0], motion[3], F_n)
        return F_t, F_y, F_n, M_x, M_y, M_z
