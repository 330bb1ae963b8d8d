"""Grounds: what terrains are made of, and how far what they add is alike.

    A^2 T,   T = (1 - own) exp(-(a_g - a_h)^2 / 2 la^2) rho^e F + own [g = h]
    e = |ln(d_g / d_h)| / ln(37 / 19)

among stones, with inclines a along the push and grain sizes d; rho is what stones of 19
and of 37 mm share. As a correlation over ln d that is an Ornstein-Uhlenbeck process
(Rasmussen and Williams 2006, eq. 4.29), so T is positive definite. F is a factor for
each further thing that varies between the terrains: exp(-|x_g - x_h| / lambda) of a
number, over its spread, and rho_f^[differ] of a word. A plate is like itself only, and
so is ground of which an active factor does not apply. `hierarchy` has the process.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array, Indices
from analysis.data.terrain_kinds import FLAT, SIZE_BY_WORD, Value, grain_size
from analysis.gp.trial_noise import TrialRows

MOST_TERMS = 6  # factors that the model takes beside incline and grain size
BASE = 14  # hyperparameters without them
_OCTAVE = math.log(SIZE_BY_WORD["big"]) - math.log(SIZE_BY_WORD["small"])


class Ground(NamedTuple):
    """What a terrain is made of.

    Attributes:
        terrain: its name.
        size: of the stones: "small", "big", e.g. "12 mm", or "flat" for a plate.
        incline_deg: its incline along the push, positive downhill [degrees].
        factors: names and values of what else is known of it, the foot among them; a
            number that is compared by its logarithm is one.
    """

    terrain: str
    size: str
    incline_deg: float
    factors: tuple[tuple[str, Value], ...] = ()

    @property
    def is_plate(self) -> bool:
        """Whether it has no stones."""
        return self.size == FLAT

    @property
    def log_size(self) -> float:
        """Ln d of its stones [mm]; nan where it has none or none is known."""
        size = grain_size(self.size)
        return math.nan if size is None else math.log(size)

    def value(self, name: str) -> Value:
        """Return the value of a factor; None where it has none."""
        return dict(self.factors).get(name)


class FactorTerm(NamedTuple):
    """A factor that varies between the terrains of a model.

    Attributes:
        name: of the factor.
        scale: spread of a number among the terrains; 0 for a word.
        known: its values among them.
    """

    name: str
    scale: float
    known: tuple[float | str, ...]

    @property
    def is_word(self) -> bool:
        """Whether its values are words."""
        return self.scale == 0.0

    @property
    def parameter(self) -> str:
        """Name of its hyperparameter."""
        return f"{'logit_rho' if self.is_word else 'log_lambda'}_{self.name}"

    def distance(self, some: Ground, other: Ground) -> float:
        """Return how far two grounds are apart; nan where it does not apply to one.

        Of a word 0 or 1, of a number in units of its spread.
        """
        x, y = some.value(self.name), other.value(self.name)
        if x is None or y is None:
            return math.nan
        if isinstance(x, str) or isinstance(y, str):
            return float(x != y)
        return abs(x - y) / self.scale


def terms_of(grounds: Sequence[Ground]) -> tuple[FactorTerm, ...]:
    """Return the factors that vary between grounds of stones, at most six.

    One that tells no two of them apart would have a hyperparameter that only its prior
    fixes. They come in the order in which the grounds state them.
    """
    return _varying(grounds)[:MOST_TERMS]


def left_out(grounds: Sequence[Ground]) -> tuple[str, ...]:
    """Return the names of varying factors beyond those that the model takes."""
    return tuple(term.name for term in _varying(grounds)[MOST_TERMS:])


def _varying(grounds: Sequence[Ground]) -> tuple[FactorTerm, ...]:
    stones = [ground for ground in grounds if not ground.is_plate]
    names = dict.fromkeys(name for ground in stones for name, _ in ground.factors)
    terms: list[FactorTerm] = []
    for name in names:
        stated = [ground.value(name) for ground in stones]
        known = tuple(dict.fromkeys(value for value in stated if value is not None))
        if len(known) < 2:
            continue
        numbers = [value for value in stated if isinstance(value, float)]
        is_word = any(isinstance(value, str) for value in known)
        terms.append(
            FactorTerm(name, 0.0 if is_word else float(np.std(numbers)), known)
        )
    return tuple(terms)


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
        return TrialRows(self.trial).blocks()


class Resemblance:
    """A^2 T between grounds: the covariance of what they add.

    Args:
        some: g grounds.
        others: h grounds.
        terms: the factors that the model takes.
    """

    def __init__(
        self,
        some: Sequence[Ground],
        others: Sequence[Ground],
        terms: Sequence[FactorTerm] = (),
    ) -> None:
        def table(relation: Callable[[Ground, Ground], float]) -> Array:
            return np.array([[float(relation(g, h)) for h in others] for g in some])

        self._gap2 = table(lambda g, h: (g.incline_deg - h.incline_deg) ** 2)
        self._same = table(lambda g, h: g.terrain == h.terrain)
        apart = table(lambda g, h: abs(g.log_size - h.log_size) / _OCTAVE)
        stones = table(lambda g, h: not g.is_plate and not h.is_plate)
        distances = [table(term.distance) for term in terms]
        is_known = np.isfinite(apart)
        for distance in distances:
            is_known &= np.isfinite(distance)
        self._resized = np.where(is_known, apart, 0.0)
        self._terms = [
            (BASE + k, term.is_word, np.where(is_known, distance, 0.0))
            for k, (term, distance) in enumerate(zip(terms, distances, strict=True))
        ]
        # a ground is wholly like itself, whatever does not apply to it
        is_alike = is_known | (self._same > 0.0)
        self._stones, self._related = stones, stones * is_alike
        self._plates = table(lambda g, h: g.is_plate and h.is_plate) * self._same

    def at(self, theta: Array) -> tuple[Array, Mapping[int, Array]]:
        """Return A^2 T, shape (g, h), and its slopes by number of the hyperparameter.

        Args:
            theta: hyperparameters, in the order of `hierarchy.names_of`.
        """
        A2, A2_plate = np.exp(2.0 * theta[3:5])
        la2 = np.exp(2.0 * theta[7])
        rho, own = 1.0 / (1.0 + np.exp(-theta[8:10]))
        alike = np.exp(-0.5 * self._gap2 / la2) * rho**self._resized * self._related
        growth: dict[int, Array | float] = {}
        for k, is_word, distance in self._terms:
            if is_word:
                share = 1.0 / (1.0 + np.exp(-theta[k]))
                alike = alike * share**distance
                growth[k] = distance * (1.0 - share)
            else:
                apart = distance * np.exp(-theta[k])
                alike = alike * np.exp(-apart)
                growth[k] = apart
        same, plates = self._same * self._stones, A2_plate * self._plates
        stones, smooth = A2 * ((1.0 - own) * alike + own * same), A2 * (1.0 - own)
        slopes = {
            3: 2.0 * stones,
            4: 2.0 * plates,
            7: smooth * alike * self._gap2 / la2,
            8: smooth * alike * self._resized * (1.0 - rho),
            9: A2 * own * (1.0 - own) * (same - alike),
        }
        slopes |= {k: smooth * alike * rate for k, rate in growth.items()}
        return stones + plates, slopes
