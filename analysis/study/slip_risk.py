"""Break-away model of a terrain: slip risk at a force, and force at a risk.

There are two kinds. "break-away": the distribution of the peak of a push, see
`push_likelihood`. "sliding", if too few pushes slipped for that: F_t while the foot
moves at 0.005 to 0.02 m/s, F_t = a + b F_n + u_trial + s e with normal u and e.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from acquisition.errors import SettingsError
from acquisition.validation import Many
from analysis.data.series import Array
from analysis.study.push_likelihood import nodes, share_weaker
from analysis.study.pushes import log_load

BREAK_AWAY, SLIDING = "break-away", "sliding"
INTERVAL = (0.05, 0.95)  # 90 % interval over bootstrap draws of trials
_FAMILIES = {BREAK_AWAY: "weibull", SLIDING: "lognormal"}  # names in the file
_HALVINGS = 60  # bisection steps for a force
_WIDE = 40.0  # half width of the initial bracket [spreads]
_LARGEST_LOG = 50.0  # limit of a log force, far beyond any force
_LARGEST_PARAMETER, _LEAST_SPREAD = 1e4, 1e-6
_DIGITS = 6  # significant digits of a stored number
_MOST_DRAWS = 2000
_MOST = 10_000_000  # slips, held pushes or trials

_Parameter = Annotated[float, Field(ge=-_LARGEST_PARAMETER, le=_LARGEST_PARAMETER)]
_Spread = Annotated[_Parameter, Field(ge=_LEAST_SPREAD)]
_Positive = Annotated[float, Field(ge=0.0)]
_Count = Annotated[int, Field(ge=0, le=_MOST)]
_Law = tuple[_Parameter, _Parameter, _Spread, Annotated[_Parameter, Field(ge=0.0)]]


@dataclass(frozen=True, slots=True)
class BreakAwayRisk:
    """Probability that a push slips before it reaches the required force.

    Attributes:
        risk: probability, 0 to 1.
        low: lower end of the 90 % bootstrap interval.
        high: upper end of that interval.
        kind: "break-away", or "sliding" where too few pushes slipped.
        v_slip: velocity threshold of a slip [m/s].
        slips: number of fitted pushes that slipped.
        held: number of fitted pushes that held.
        is_extrapolated: F_n or the force lies outside 2 to 98 % of the pushes.
    """

    risk: float
    low: float
    high: float
    kind: str
    v_slip: float
    slips: int
    held: int
    is_extrapolated: bool


@dataclass(frozen=True, slots=True)
class AvailableForce:
    """Force available at a risk.

    Attributes:
        force: F_t [N].
        low: lower end of the 90 % bootstrap interval [N].
        high: upper end of that interval [N].
        is_extrapolated: F_n or the force lies outside 2 to 98 % of the pushes.
    """

    force: float
    low: float
    high: float
    is_extrapolated: bool


@dataclass(frozen=True, slots=True)
class PushLaw:
    """Parameters of the law of one terrain.

    Attributes:
        level: b0 [nat] or a [N].
        slope: b1, coefficient of log(F_n / 3.5 N), or b [N/N].
        spread: s [nat] or [N].
        trial_sd: standard deviation of the trial effect, su [nat] or [N].
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
    """Break-away model of a terrain.

    Attributes:
        kind: "break-away" or "sliding".
        law: fit to all trials.
        draws: fits to resampled trials, columns as `PushLaw`, shape (n, 4).
        v_slip: velocity threshold of a slip [m/s].
        slips: number of pushes that slipped.
        held: number of pushes that held.
        trials: number of trials.
        loads: 2 and 98 % points of F_n of the pushes [N].
        forces: 2 and 98 % points of their peaks [N].
        distance: distance of the model from the Kaplan-Meier curve; NaN for sliding.
        is_trial_seen: the trial effect is significant.
    """

    kind: str
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

        Applies to one push from rest at constant F_n, in a new trial, at a location not
        pushed before: a slip means that v_t exceeds v_slip before F_t reaches
        `required`. It does not apply to a foot that already slides or to a location
        that has just held. At least one of n such pushes slips with probability
        1 - (1 - risk)^n.

        If `kind` is "sliding", the result is the probability that F_t at 0.005 to
        0.02 m/s is less than `required`: the traction left once the foot moves.

        Args:
            required: traction that the push needs [N], >= 0.
            F_n: normal force while pushing [N], >= 0.

        Raises:
            SettingsError: a value is negative or not finite.
        """
        _check_forces(required=required, F_n=F_n)
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
        """Return the force at which `slip_risk` equals `risk`; never below zero.

        Args:
            F_n: normal force while pushing [N], >= 0.
            risk: probability of a slip, above 0 and below 1.

        Raises:
            SettingsError: a value is not finite, F_n is negative or the risk is not
                between 0 and 1.
        """
        _check_forces(F_n=F_n)
        if not 0.0 < risk < 1.0:
            raise SettingsError(
                f"risk = {risk} is not between 0 and 1.", hint="Give e.g. 0.1."
            )
        laws = np.vstack([self.law.values, self.draws])
        forces = self._forces(laws, F_n, risk)
        low, high = _interval(forces)
        return AvailableForce(
            force=float(forces[0]),
            low=low,
            high=high,
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
        """Return P(F < required) under every law, marginal over the trial effect."""
        if self.kind == SLIDING:
            return _mixed(self.kind, laws, required - self._centre(laws, F_n))
        with np.errstate(divide="ignore"):
            logs = np.log(required)
        return _mixed(self.kind, laws, logs - self._centre(laws, F_n))

    def _forces(self, laws: Array, F_n: Array | float, risk: float) -> Array:
        """Return the quantile [N] at `risk` under every law, by bisection."""
        reach = _WIDE * (laws[:, 2] + laws[:, 3])
        low, high = -reach, reach
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            is_under = _mixed(self.kind, laws, middle) < risk
            low, high = (
                np.where(is_under, middle, low),
                np.where(is_under, high, middle),
            )
        quantile = self._centre(laws, F_n) + 0.5 * (low + high)
        if self.kind == SLIDING:
            return np.maximum(quantile, 0.0)
        return np.exp(np.minimum(quantile, _LARGEST_LOG))

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
            "family": _FAMILIES[self.kind],
        }
        return _BreakAwayFile.model_construct(**values).model_dump(mode="json")

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "BreakAwayModel":
        """Restore a model from plain values; all are validated.

        Raises:
            ValueError: a value is missing or invalid.
        """
        file = _BreakAwayFile.model_validate(content)
        values = file.model_dump(exclude={"family"}) | {
            "law": PushLaw(*file.law),
            "draws": np.array(file.draws).reshape(-1, 4),
            "distance": math.nan if file.distance is None else file.distance,
        }
        return cls(**values)


class _BreakAwayFile(BaseModel):
    """Stored form of a model."""

    model_config = ConfigDict(allow_inf_nan=False)

    kind: Literal["break-away", "sliding"]
    family: Literal["weibull", "lognormal"]
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

    @model_validator(mode="after")
    def _is_known_family(self) -> "_BreakAwayFile":
        if self.family != _FAMILIES[self.kind]:
            raise ValueError(
                f"family: {self.kind} has {_FAMILIES[self.kind]}, not {self.family}; "
                "make the database again"
            )
        return self


def _mixed(kind: str, laws: Array, above: Array) -> Array:
    """Return P(u + s e < above) under every law, shape (n,).

    Args:
        kind: "break-away" or "sliding".
        laws: parameters, shape (n, 4).
        above: distances from the centre, shape (n,).
    """
    spread, trial_sd = laws[:, 2], laws[:, 3]
    if kind == SLIDING:
        from scipy.special import ndtr

        return np.asarray(ndtr(above / np.hypot(spread, trial_sd)), dtype=np.float64)
    points, weights = nodes()
    z = (above[:, None] - trial_sd[:, None] * points) / spread[:, None]
    return share_weaker(z) @ weights


def _interval(values: Array) -> tuple[float, float]:
    """Return the ends of the interval over all values but the first."""
    drawn = values[1:] if values.size > 1 else values
    low, high = np.quantile(drawn, INTERVAL)
    return float(low), float(high)


def _rounded(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(float(f"{value:.{_DIGITS}g}") for value in values)


def check_finite(**values: float) -> None:
    """Refuse values that are not finite numbers.

    Raises:
        SettingsError: a value is not a finite number.
    """
    for name, value in values.items():
        try:
            is_finite = math.isfinite(value)
        except (TypeError, OverflowError):  # text, array, huge integer
            is_finite = False
        if not is_finite:
            raise SettingsError(f"{name} = {value!r:.40} is not a finite number.")


def _check_forces(**forces: float) -> None:
    """Refuse forces that are negative or not finite; raises SettingsError."""
    check_finite(**forces)
    for name, force in forces.items():
        if force < 0.0:
            raise SettingsError(
                f"{name} = {force:g} N is negative.", hint="Give a force of 0 or more."
            )
