"""Query interface of the terrain database.

`database.load` reads and validates a file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from numbers import Integral, Real
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.data.terrain_kinds import Value
from analysis.study.metrics import Prediction
from analysis.study.slip_risk import BreakAwayModel, BreakAwayRisk, check_finite
from analysis.terrains.classifier import SurfaceClassifier
from analysis.terrains.path_copula import PathCopula
from analysis.terrains.points import points_of
from analysis.terrains.table import SlipRisk, Table, TractionEstimate, TractionEstimates


@dataclass(frozen=True, slots=True)
class KnownTerrain:
    """One terrain of a database.

    Attributes:
        name: name of the terrain.
        kind: "small", "big", "flat" or a word of its own.
        trials: number of trials fitted.
        samples: number of samples fitted.
        rho: correlation of residuals from one kept sample to the next.
        limits: upper limit of the mean strain by window size [kept samples].
        tables: table by model name.
        parameters: fitted parameters by model name.
        default: name of the model used by default.
        titles: title by model name.
        recogniser: name of the model used for recognition, to which `rho` and `limits`
            belong; "" = the default.
        roughness: lower limit of the log sd of F_t about a line in F_n [nat] by window
            size [kept samples].
        break_away: model of the force at which a foot at rest slips; None = not known.
        incline_deg: along the push, positive downhill [degrees]; None where unknown.
        factors: recorded factors by name, foot included; None = does not apply.
        copula: dependence of the forces along a path; None = not known.
    """

    name: str
    kind: str
    trials: int
    samples: int
    rho: float
    limits: Mapping[int, float]
    tables: Mapping[str, Table]
    parameters: Mapping[str, Any]
    default: str
    titles: Mapping[str, str] = field(default_factory=dict)
    recogniser: str = ""
    roughness: Mapping[int, float] = field(default_factory=dict[int, float])
    break_away: BreakAwayModel | None = None
    incline_deg: float | None = None
    factors: Mapping[str, Value] = field(default_factory=dict[str, Value])
    copula: PathCopula | None = None

    @overload
    def predict(self, F_n: float, v_t: float, model: str = "") -> TractionEstimate: ...

    @overload
    def predict(
        self, F_n: Array | Sequence[float], v_t: ArrayLike, model: str = ""
    ) -> TractionEstimates: ...

    @overload
    def predict(
        self, F_n: float, v_t: Array | Sequence[float], model: str = ""
    ) -> TractionEstimates: ...

    def predict(
        self, F_n: ArrayLike, v_t: ArrayLike, model: str = ""
    ) -> TractionEstimate | TractionEstimates:
        """Predict the traction of a new trial at one point or many.

        Args:
            F_n: normal force [N], a number or shape (n,).
            v_t: slip velocity [m/s], a number or shape (n,).
            model: name of a model; "" = the default.

        Returns:
            The estimate at one point for two numbers, otherwise at n points.

        Raises:
            SettingsError: there is no such model, or a value is not finite.
        """
        table = self._table(model)
        if isinstance(F_n, Real) and isinstance(v_t, Real):
            load, speed = float(F_n), float(v_t)
            check_finite(F_n=load, v_t=speed)
            forces = table.at(load, speed)
            return TractionEstimate(table.shares, forces, not table.covers(load, speed))
        loads, speeds = points_of(F_n, v_t)
        is_outside = ~table.covers_many(loads, speeds)
        return TractionEstimates(table.shares, table.over(loads, speeds), is_outside)

    def sample(
        self,
        F_n: ArrayLike,
        v_t: ArrayLike,
        dt: float,
        seed: int | np.random.Generator,
        count: int = 1,
    ) -> Array:
        """Draw traction forces of new trials along a path [N], shape (count, n).

        Each row is one trial with a common level along the path and correlated
        neighbouring forces; see `analysis.terrains.path_copula`. A foot slower than the
        slowest one measured sticks. Outside the measured range forces are clamped to
        those of its edge. Forces are not negative where no quantile is.

        Args:
            F_n: normal force at every step [N], shape (n,).
            v_t: slip velocity at every step [m/s], shape (n,).
            dt: time from one step to the next [s].
            seed: seed of the draws, or a random generator.
            count: number of trials.

        Raises:
            SettingsError: F_n and v_t are not finite or differ in shape, dt is not
                positive and finite, seed or count is invalid, or the terrain has no
                copula.
        """
        if self.copula is None:
            raise SettingsError(
                f"{self.name}: the correlation of forces along a path is not known.",
                hint="Export the database again, with two trials or more per terrain.",
            )
        loads, speeds = points_of(F_n, v_t)
        if not (isinstance(dt, Real) and 0.0 < dt < inf):
            raise SettingsError(
                f"dt = {dt!r:.60} is not a time between two steps.",
                hint="Give a positive number of seconds, e.g. dt=0.01.",
            )
        if not (isinstance(count, Integral) and count > 0):
            raise SettingsError(
                f"count = {count!r:.60} is not a number of trials.",
                hint="Give a whole number of at least 1.",
            )
        normals = _generator(seed).standard_normal((int(count), 1 + loads.size))
        is_stuck = np.abs(speeds) < self._table("").v_t[0]
        scores = self.copula.scores(is_stuck, float(dt), normals)
        return self.predict(loads, speeds).at_scores(scores)

    def prediction(self, F_n: Array, v_t: Array) -> Prediction:
        """Return mean and standard deviation by the model used for recognition."""
        many = self.predict(F_n, v_t, self.recogniser)
        return Prediction(many.mean, many.sd)

    def slip_risk(self, required: float, F_n: float) -> BreakAwayRisk:
        """Return the slip risk of a push from rest, see `BreakAwayModel.slip_risk`.

        Raises:
            SettingsError: a value is negative or not finite, or the model is not known.
        """
        return self.from_rest.slip_risk(required, F_n)

    @property
    def has_from_rest(self) -> bool:
        """Whether the database has a break-away model of the terrain."""
        return self.break_away is not None

    @property
    def from_rest(self) -> BreakAwayModel:
        """Model of the force at which a foot at rest slips.

        Raises:
            SettingsError: the model is not known.
        """
        if self.break_away is None:
            raise SettingsError(
                f"{self.name}: the break-away force from rest is not known.",
                hint="Record three trials or more; risk_in_motion answers for sliding.",
            )
        return self.break_away

    def risk_in_motion(self, required: float, F_n: float, v_t: float = 0.0) -> SlipRisk:
        """Return the probability that a sliding foot gets less than `required` [N].

        Velocities below the slowest one measured are raised to it. A load or velocity
        outside the table sets `is_extrapolated` of the result.

        Raises:
            SettingsError: a value is not a finite number.
        """
        check_finite(required=required, F_n=F_n, v_t=v_t)
        table = self._table("")
        risk = self.predict(F_n, v_t).probability_below(required)
        is_covered = table.covers(F_n, max(v_t, table.v_t[0]))
        return SlipRisk(risk, is_extrapolated=not is_covered)

    def _table(self, model: str) -> Table:
        table = self.tables.get(model or self.default)
        if table is None:
            raise SettingsError(
                f"{self.name}: there is no model {model!r}.",
                hint=f"Models: {', '.join(self.tables)}.",
            )
        return table


def _generator(seed: int | np.random.Generator) -> np.random.Generator:
    if isinstance(seed, np.random.Generator):
        return seed
    if not isinstance(seed, Integral) or seed < 0:
        raise SettingsError(
            f"seed = {seed!r:.60} is not a seed.",
            hint="Give a whole number of at least 0, or a generator of numpy.",
        )
    return np.random.default_rng(int(seed))


@dataclass(frozen=True, slots=True)
class TerrainDatabase:
    """Terrains by name.

    Attributes:
        terrains: every terrain.
        is_simulated: the trials were simulated.
        made_utc: time at which the database was made.
        surfaces: classifier of flat and rocky ground; None = not known.
    """

    terrains: Mapping[str, KnownTerrain]
    is_simulated: bool
    made_utc: str
    surfaces: SurfaceClassifier | None = None

    def terrain(self, name: str) -> KnownTerrain:
        """Return a terrain by name.

        Raises:
            SettingsError: there is no terrain of that name.
        """
        if name not in self.terrains:
            raise SettingsError(
                f"There is no terrain {name!r} in the database.",
                hint=f"Terrains: {', '.join(self.terrains)}.",
            )
        return self.terrains[name]
