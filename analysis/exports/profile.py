"""One coefficient of friction per episode, for programs that hold no more.

A terrain is a distribution of F_t over F_n and v_t; a simulator takes one mu for a
whole episode. What may be drawn once per episode is the *trial's* level: with the
median F_50(F_n, v_t) of the model, its warp z, the standard deviation sc of the effect
of a trial in z and k degrees of freedom of that (`analysis.study.distribution`),

    mu(p) = median over the window of  z^-1( z(F_50) + sc t_k(p) ) / F_n

with t_k the quantiles of Student's t. What changes within a trial (jams and slips) is
not in it, unless all of the spread is asked for. Coefficients below 0, where the ground
pushes the foot on, become 0; the profile says how many.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from acquisition.errors import SettingsError
from analysis.breakaway.model import BREAK_AWAY
from analysis.data.series import Array
from analysis.study.distribution import FEWEST
from analysis.study.skew import unwarped, warped
from analysis.terrains.known import KnownTerrain
from analysis.terrains.table import Table, TractionEstimates

Spread = Literal["episode", "all"]
LOADS, SPEEDS = (2.0, 10.0), (0.01, 0.15)  # N, m/s: the window of a walking foot
PROFILE_SHARES = tuple(round(0.005 + 0.99 * k / 60, 6) for k in range(61))
_POINTS = 33  # of each axis of the window
_FINE = 199  # shares that the whole spread is pooled from
_LEAST_LOAD = 0.5  # N, below which a quotient by F_n says nothing


class _LevelTheta(BaseModel):
    """Logarithms of the hyperparameters; `log_sp` is that of a level by F_n."""

    log_sc: float = Field(ge=-50.0, le=10.0)
    log_sp: float | None = None


class _LevelParameters(BaseModel):
    """What a model of a new trial says of the effect of a trial."""

    theta: _LevelTheta
    trials: int = Field(ge=2, le=1_000_000_000)
    c: float | None = Field(default=None, gt=0.0, le=1e6)


@dataclass(frozen=True, slots=True)
class TrialLevel:
    """The effect of a trial on the force of a terrain.

    Attributes:
        sd: standard deviation in z [N].
        freedom: degrees of freedom of that.
        c: of the warp z = c log(y + c) [N]; None for z = y.
    """

    sd: float
    freedom: int
    c: float | None

    @classmethod
    def of(cls, known: KnownTerrain, model: str) -> "TrialLevel | None":
        """Return the effect in the parameters of a model, None where there is none."""
        try:
            stored = _LevelParameters.model_validate(known.parameters.get(model))
        except ValidationError:
            return None
        if stored.theta.log_sp is not None:
            return None
        freedom = max(stored.trials - 1, FEWEST)
        return cls(math.exp(stored.theta.log_sc), freedom, stored.c)

    def forces(self, median: Array, shares: Array) -> Array:
        """Return F_t [N] of trials at these shares, shape (q, n), around a median."""
        from scipy.special import stdtrit

        steps = self.sd * stdtrit(self.freedom, shares)
        return unwarped(warped(median, self.c) + steps[:, None], self.c)


@dataclass(frozen=True, slots=True)
class FrictionProfile:
    """The coefficient of friction of a terrain for a whole episode.

    Attributes:
        spread: "episode": of the trial's level; "all": of single rows too.
        F_n: window of normal forces [N].
        v_t: window of slip velocities [m/s].
        shares: of the quantiles.
        mu: coefficient that is not reached with each share, none below 0.
        clipped: share of the distribution that was below 0 and is 0.
        least_median, most_median: of the median over the window; one number loses that.
        level_sd: standard deviation of the trial's level [1]; None = not known.
        within_sd: of what changes within a trial [1].
        rho: correlation of that from one sample to the next, 10 ms later.
        static: coefficient that holds every second push from rest; None = not known.
        trials: number of trials.
        is_simulated: the trials were simulated.
        lost: what no coefficient holds.
    """

    spread: Spread
    F_n: tuple[float, float]
    v_t: tuple[float, float]
    shares: tuple[float, ...]
    mu: tuple[float, ...]
    clipped: float
    least_median: float
    most_median: float
    level_sd: float | None
    within_sd: float
    rho: float
    static: float | None
    trials: int
    is_simulated: bool
    lost: str

    def quantile(self, share: float) -> float:
        """Return the coefficient that is not reached with probability `share`."""
        return float(np.interp(share, self.shares, self.mu))

    @property
    def static_over_sliding(self) -> float:
        """Coefficient from rest over the sliding median, at least 1; 1 = not known."""
        median = self.quantile(0.5)
        if self.static is None or median <= 0.0:
            return 1.0
        return max(self.static / median, 1.0)

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values, for JSON."""
        return asdict(self) | {"static_over_sliding": self.static_over_sliding}


def profile_of(
    known: KnownTerrain, model: str, spread: Spread, *, is_simulated: bool
) -> FrictionProfile:
    """Return the profile of a terrain by one of its models.

    Raises:
        SettingsError: the table of the model has no load above 0.5 N.
    """
    table = known.tables[model]
    loads, speeds = _window(known.name, table)
    F_n, v_t = (
        grid.ravel()
        for grid in np.meshgrid(
            np.linspace(*loads, _POINTS), np.linspace(*speeds, _POINTS), indexing="ij"
        )
    )
    estimates = TractionEstimates(
        table.shares, table.over(F_n, v_t), np.zeros(F_n.size, dtype=np.bool_)
    )
    shares = np.array(PROFILE_SHARES)
    level = TrialLevel.of(known, model)
    median = estimates.median
    by_trial = np.tile(median, (shares.size, 1))
    if level is not None:
        by_trial = level.forces(median, shares)
    if spread == "all":
        fine = (np.arange(_FINE) + 0.5) / _FINE
        pooled = np.array([estimates.quantile(float(s)) for s in fine]) / F_n
        mu = np.quantile(pooled, shares)
        clipped = float(np.mean(pooled < 0.0))
    else:
        mu = np.median(by_trial / F_n, axis=1)
        clipped = float(np.interp(0.0, mu, shares, left=0.0, right=1.0))
    level_variance = by_trial.var(axis=0)
    within = np.sqrt(np.maximum(estimates.sd**2 - level_variance, 0.0))
    return FrictionProfile(
        spread=spread,
        F_n=loads,
        v_t=speeds,
        shares=PROFILE_SHARES,
        mu=tuple(np.round(np.maximum(mu, 0.0), 6).tolist()),
        clipped=round(clipped, 6),
        least_median=round(float((median / F_n).min()), 6),
        most_median=round(float((median / F_n).max()), 6),
        level_sd=(
            None
            if level is None
            else round(float(np.median(np.sqrt(level_variance) / F_n)), 6)
        ),
        within_sd=round(float(np.median(within / F_n)), 6),
        rho=known.rho,
        static=_static(known, loads),
        trials=known.trials,
        is_simulated=is_simulated,
        lost=(
            "one number for all F_n and v_t; not anisotropic, no sinkage, not for "
            "other feet or inclines"
        ),
    )


def _window(name: str, table: Table) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return what the usual window and a table share; all of the table if nothing."""
    loads, speeds = _shared(LOADS, table.F_n), _shared(SPEEDS, table.v_t)
    loads = (max(loads[0], _LEAST_LOAD), loads[1])
    if loads[0] >= loads[1]:
        raise SettingsError(
            f"{name!r:.60}: its table ends at F_n = {table.F_n[-1]:g} N, too little "
            "load for a coefficient of friction.",
            hint="Leave it out with --terrain. Nothing was written.",
        )
    return loads, speeds


def _shared(
    wanted: tuple[float, float], axis: tuple[float, ...]
) -> tuple[float, float]:
    low, high = max(wanted[0], axis[0]), min(wanted[1], axis[-1])
    return (low, high) if low < high else (axis[0], axis[-1])


def _static(known: KnownTerrain, loads: tuple[float, float]) -> float | None:
    """Return the coefficient from rest; None where no push slipped or it is unknown."""
    if not known.has_from_rest:
        return None
    model = known.from_rest
    if model.kind != BREAK_AWAY:
        return None
    F_n = np.linspace(*_shared(loads, model.loads), _POINTS)
    F_n = F_n[F_n >= _LEAST_LOAD]
    if not F_n.size:
        return None
    return round(float(np.median(model.curve(F_n, 0.5) / F_n)), 6)
