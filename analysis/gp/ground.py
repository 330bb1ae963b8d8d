"""Grounds: what terrains are made of, and how far what they add is alike.

    A^2 T,   T = (1 - own) exp(-(a_g - a_h)^2 / 2 la^2) rho^[sizes differ] + own [g = h]

among stones, with inclines a; a plate is like itself only. `hierarchy` has the process.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array, Indices
from analysis.data.terrain_kinds import FLAT
from analysis.gp.trial_noise import TrialRows


class Ground(NamedTuple):
    """What a terrain is made of.

    Attributes:
        terrain: its name.
        size: of the stones: "small", "big", or "flat" for a plate.
        incline_deg: its incline [degrees].
    """

    terrain: str
    size: str
    incline_deg: float

    @property
    def is_plate(self) -> bool:
        """Whether it has no stones."""
        return self.size == FLAT


@dataclass(frozen=True, slots=True, eq=False)
class GroundRows:
    """Rows of several grounds; those of a ground, and of a trial, stand together.

    Attributes:
        inputs: (F_n [N], v_t [m/s]), shape (n, 2).
        y: outputs, shape (n,).
        ground: place of every row's ground in `grounds`, shape (n,).
        trial: number of its trial, no number on two grounds, shape (n,).
        grounds: the grounds.
    """

    inputs: Array
    y: Array
    ground: Indices
    trial: Indices
    grounds: tuple[Ground, ...]

    @property
    def is_plate(self) -> Array:
        """1 for a row on a plate, 0 for one on stones, shape (n,)."""
        return np.array([float(g.is_plate) for g in self.grounds])[self.ground]

    @property
    def freedom(self) -> tuple[int, int]:
        """Degrees of freedom of the spread between trials, on stones and plates."""
        pairs = {*zip(self.ground.tolist(), self.trial.tolist(), strict=True)}
        left = [0, 0]
        for index, ground in enumerate(self.grounds):
            count = sum(g == index for g, _ in pairs)
            left[ground.is_plate] += max(count - 1, 0)
        return left[0], left[1]

    def blocks(self) -> list[slice]:
        """Return the rows of every trial."""
        return TrialRows(self.trial, np.zeros(self.trial.size)).blocks()


class Resemblance:
    """A^2 T between grounds: the covariance of what they add.

    Args:
        some: g grounds.
        others: h grounds.
    """

    def __init__(self, some: Sequence[Ground], others: Sequence[Ground]) -> None:
        def table(relation: Callable[[Ground, Ground], float]) -> Array:
            return np.array([[float(relation(g, h)) for h in others] for g in some])

        self._gap2 = table(lambda g, h: (g.incline_deg - h.incline_deg) ** 2)
        self._resized = table(lambda g, h: g.size != h.size)
        self._same = table(lambda g, h: g.terrain == h.terrain)
        self._stones = table(lambda g, h: not g.is_plate and not h.is_plate)
        self._plates = table(lambda g, h: g.is_plate and h.is_plate) * self._same

    def at(self, theta: Array) -> tuple[Array, Mapping[int, Array]]:
        """Return A^2 T, shape (g, h), and its slopes by number of the hyperparameter.

        Args:
            theta: hyperparameters, in the order of `hierarchy.NAMES`.
        """
        A2, A2_plate = np.exp(2.0 * theta[3:5])
        la2 = np.exp(2.0 * theta[7])
        rho, own = 1.0 / (1.0 + np.exp(-theta[8:10]))
        alike = np.exp(-0.5 * self._gap2 / la2) * rho**self._resized * self._stones
        same, plates = self._same * self._stones, A2_plate * self._plates
        stones, smooth = A2 * ((1.0 - own) * alike + own * same), A2 * (1.0 - own)
        slopes = {
            3: 2.0 * stones,
            4: 2.0 * plates,
            7: smooth * alike * self._gap2 / la2,
            8: smooth * alike * self._resized * (1.0 - rho),
            9: A2 * own * (1.0 - own) * (same - alike),
        }
        return stones + plates, slopes
