"""A terrain's break-away force as a model that answers: risk, and force at a risk.

Two kinds of answer. "break-away": the distribution of the peak of a push, see
`censored`. "sliding", where too few pushes slip for that: F_t while the foot moves at
0.005 to 0.02 m/s, F_t = a + b F_n + u_trial + s e with normal u and e.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator

from acquisition.validation import Many
from analysis.breakaway.answers import (
    AvailableForce,
    BreakAwayRisk,
    check_query,
    check_share,
)
from analysis.breakaway.censored import Family, nodes, share_below
from analysis.breakaway.pushes import log_load
from analysis.data.series import Array

BREAK_AWAY, SLIDING = "break-away", "sliding"
INTERVAL = (0.05, 0.95)  # of the trial bootstraps: 90 %
_HALVINGS = 60  # of an interval of forces
_WIDE = 40.0  # spreads that it begins with
_LARGEST_LOG = 50.0  # exp of it is far beyond any force
_LARGEST_PARAMETER, _LEAST_SPREAD = 1e4, 1e-6
_DIGITS = 6  # of a stored number
_MOST_DRAWS = 2000
_MOST = 10_000_000  # slips, held pushes or trials

_Parameter = Annotated[float, Field(ge=-_LARGEST_PARAMETER, le=_LARGEST_PARAMETER)]
_Spread = Annotated[_Parameter, Field(ge=_LEAST_SPREAD)]
_Positive = Annotated[float, Field(ge=0.0)]
_Count = Annotated[int, Field(ge=0, le=_MOST)]
_Law = tuple[_Parameter, _Parameter, _Spread, Annotated[_Parameter, Field(ge=0.0)]]


@dataclass(frozen=True, slots=True)
class PushLaw:
    """Parameters of one terrain's law.

    Attributes:
        level: b0 [nat] or a [N].
        slope: b1, by log(F_n / 3.5 N), or b [N/N].
        spread: s [nat] or [N].
        trial_sd: standard deviation of the effect of the trial, su [nat] or [N].
    """

    level: float
    slope: float
    spread: float
    trial_sd: float

    @property
    def values(self) -> tuple[float, float, float, float]:
        """The four numbers in order."""
        return self.level, self.slope, self.spread, self.trial_sd


@dataclass(frozen=True, slots=True, eq=False)
class BreakAwayModel:
    """What a terrain gives before it goes.

    Attributes:
        kind: "break-away" or "sliding".
        family: distribution of the residual; normal on the force's own scale where
            the kind is "sliding".
        law: the fit of all trials.
        draws: the same for resampled trials, columns as `PushLaw`, shape (n, 4).
        v_slip: velocity that made a slip [m/s].
        slips: number of pushes that slipped.
        held: number of pushes that held.
        trials: number of trials.
        loads: 2 and 98 % points of F_n of the pushes [N].
        forces: 2 and 98 % points of their peaks [N].
        distance: of Kaplan and Meier's curve from the model; NaN where sliding.
        is_trial_seen: the effect of the trial is told apart from none.
    """

    kind: str
    family: Family
    law: PushLaw
    draws: Array
    v_slip: float
    slips: int
    held: int
    trials: int
    loads: tuple[float, float]
    forces: tuple[float, float]
    distance: float = float("nan")
    is_trial_seen: bool = False

    def slip_risk(self, required: float, F_n: float) -> BreakAwayRisk:
        """Return the probability that a push slips before F_t reaches `required`.

        Of one push from rest, at a place that was not pushed before, in a new trial,
        with F_n held: the foot moves faster than v_slip before F_t reaches `required`.
        Not for a foot that slides already, nor for a place that has just held; n such
        pushes slip at least once with 1 - (1 - risk)^n.

        Where `kind` is "sliding" the answer is the probability that F_t at 0.005 to
        0.02 m/s is less than `required`: what is left once the foot moves.

        Args:
            required: traction that the push needs [N], >= 0.
            F_n: normal force while pushing [N], >= 0.

        Raises:
            SettingsError: a value is negative or no finite number.
        """
        check_query(required=required, F_n=F_n)
        laws = np.vstack([self.law.values, self.draws])
        shares = self._shares(laws, np.full(len(laws), float(required)), F_n)
        low, high = _interval(shares)
        return BreakAwayRisk(
            risk=float(shares[0]),
            low=low,
            high=high,
            kind=self.kind,
            v_slip=self.v_slip,
            slips=self.slips,
            held=self.held,
            is_extrapolated=self._is_outside(F_n, required),
        )

    def available(self, F_n: float, risk: float) -> AvailableForce:
        """Return the force whose `slip_risk` is `risk`; never below zero.

        Args:
            F_n: normal force while pushing [N], >= 0.
            risk: probability of a slip, above 0 and below 1.

        Raises:
            SettingsError: a value is not a finite number, F_n is negative or the risk
                not between 0 and 1.
        """
        check_query(F_n=F_n)
        check_share(risk)
        laws = np.vstack([self.law.values, self.draws])
        forces = self._forces(laws, F_n, risk)
        low, high = _interval(forces)
        return AvailableForce(
            force=float(forces[0]),
            low=low,
            high=high,
            kind=self.kind,
            v_slip=self.v_slip,
            slips=self.slips,
            held=self.held,
            is_extrapolated=self._is_outside(F_n, float(forces[0])),
        )

    def risks(self, required: Array, F_n: Array) -> Array:
        """Return the risk of many pushes, shape (n,), without intervals or checks."""
        return self._shares(self._laws(required.size), required, F_n)

    def curve(self, F_n: Array, risk: float) -> Array:
        """Return the force available at many loads, shape (n,), without intervals."""
        return self._forces(self._laws(F_n.size), F_n, risk)

    def _laws(self, count: int) -> Array:
        return np.tile(np.array(self.law.values), (count, 1))

    def _centre(self, laws: Array, F_n: Array | float) -> Array:
        load = np.asarray(F_n, dtype=np.float64)
        return laws[:, 0] + laws[:, 1] * (
            load if self.kind == SLIDING else log_load(load)
        )

    def _shares(self, laws: Array, required: Array, F_n: Array | float) -> Array:
        """Return P(F < required) under every law, trial effect integrated out."""
        if self.kind == SLIDING:
            return _mixed(self.family, laws, required - self._centre(laws, F_n))
        with np.errstate(divide="ignore"):
            logs = np.log(required)
        return _mixed(self.family, laws, logs - self._centre(laws, F_n))

    def _forces(self, laws: Array, F_n: Array | float, risk: float) -> Array:
        """Return the force [N] at which each law's share below it is `risk`."""
        reach = _WIDE * (laws[:, 2] + laws[:, 3])
        low, high = -reach, reach
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            is_under = _mixed(self.family, laws, middle) < risk
            low, high = (
                np.where(is_under, middle, low),
                np.where(is_under, high, middle),
            )
        found = self._centre(laws, F_n) + 0.5 * (low + high)
        if self.kind == SLIDING:
            return np.maximum(found, 0.0)
        return np.exp(np.minimum(found, _LARGEST_LOG))

    def _is_outside(self, F_n: float, force: float) -> bool:
        is_load = self.loads[0] <= F_n <= self.loads[1]
        return not (is_load and self.forces[0] <= force <= self.forces[1])

    def to_dict(self) -> dict[str, Any]:
        """Return the model as plain values, for JSON."""
        values = {name: getattr(self, name) for name in self.__slots__} | {
            "law": _rounded(self.law.values),
            "draws": tuple(map(_rounded, self.draws.tolist())),
            "loads": _rounded(self.loads),
            "forces": _rounded(self.forces),
            "distance": None if math.isnan(self.distance) else self.distance,
        }
        return _BreakAwayFile.model_construct(**values).model_dump(mode="json")

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "BreakAwayModel":
        """Return the model of plain values; everything is checked.

        Raises:
            ValueError: a value is missing or not what it should be.
        """
        file = _BreakAwayFile.model_validate(content)
        values = dict(file) | {
            "law": PushLaw(*file.law),
            "draws": np.array(file.draws).reshape(-1, 4),
            "distance": math.nan if file.distance is None else file.distance,
        }
        return cls(**values)


class _BreakAwayFile(BaseModel):
    """A model as it is stored."""

    model_config = ConfigDict(allow_inf_nan=False)

    kind: Literal["break-away", "sliding"]
    family: Family
    law: _Law
    draws: Many[_Law] = Field(max_length=_MOST_DRAWS)
    v_slip: _Positive
    slips: _Count
    held: _Count
    trials: _Count
    loads: tuple[float, float]
    forces: tuple[float, float]
    distance: _Positive | None
    is_trial_seen: bool

    @field_validator("loads", "forces")
    @classmethod
    def _is_increasing(cls, ends: tuple[float, float]) -> tuple[float, float]:
        if ends[0] > ends[1]:
            raise ValueError("a range is not two increasing numbers")
        return ends


def _mixed(family: Family, laws: Array, above: Array) -> Array:
    """Return P(u + s e < above) under every law, shape (n,).

    Args:
        family: distribution of e.
        laws: parameters, shape (n, 4).
        above: distances from the centre, shape (n,).
    """
    spread, trial_sd = laws[:, 2], laws[:, 3]
    if family is Family.LOGNORMAL:
        return share_below(family, above / np.hypot(spread, trial_sd))
    points, weights = nodes()
    z = (above[:, None] - trial_sd[:, None] * points) / spread[:, None]
    return share_below(family, z) @ weights


def _interval(values: Array) -> tuple[float, float]:
    """Return the ends of the interval of all but the first value."""
    drawn = values[1:] if values.size > 1 else values
    low, high = np.quantile(drawn, INTERVAL)
    return float(low), float(high)


def _rounded(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(float(f"{value:.{_DIGITS}g}") for value in values)
