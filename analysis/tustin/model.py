"""The Tustin friction model and its fit by bounded least squares.

F_t = mu F_n + (F_s - mu F_n) exp(-|v_t/v_s|^delta_s) + b v_t             (eq. 1)

F_s is a constant in newtons. On most terrains the data identify only the curve, not
each parameter; the flags of a fit report this.
"""

from dataclasses import astuple, dataclass, field, fields
from typing import Literal

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.tustin.identifiability import Profiles, is_identifiable, is_straight
from analysis.tustin.moments import (
    Loss,
    Moments,
    profiles,
    search,
    weighted,
)
from analysis.tustin.varpro import Box, Point, Problem, stribeck_power

MINIMUM_ROWS = 20  # four per parameter
NEGATIVE_B = "b negative"  # nonphysical, like a negative mu or F_s
NOT_IDENTIFIABLE = "not identifiable"
NO_STRIBECK = "no Stribeck shape"
UNITS = {"mu": "1", "F_s": "N", "v_s": "m/s", "delta_s": "1", "b": "kg/s"}
SYMBOLS = {"mu": "μ", "F_s": "F_s", "v_s": "v_s", "delta_s": "δ_s", "b": "b"}

_LOG_EDGE = 0.01  # v_s, delta_s: relative distance that counts as on a bound
_LINEAR_EDGE = 1e-5  # mu, F_s, b: the same, relative to the width of the range


@dataclass(frozen=True, slots=True)
class TustinParameters:
    """One coherent set of parameters in canonical form.

    Attributes:
        mu: dynamic friction coefficient [-].
        F_s: largest force at standstill [N].
        v_s: Stribeck velocity [m/s]; only its absolute value enters.
        delta_s: Stribeck exponent [-].
        b: viscous coefficient [kg/s]; negative where slip unloads the foot.
    """

    mu: float
    F_s: float
    v_s: float
    delta_s: float
    b: float


@dataclass(frozen=True, slots=True)
class TustinForm:
    """Variant of the model and loss function of the fit.

    Attributes:
        static: "constant" has F_s in newtons (eq. 1 as printed), "proportional"
            F_s = f_s F_n with f_s [-] in place of F_s (as in the paper's text).
        loss: "squares" (the paper), "huber" or "student".
    """

    static: Literal["constant", "proportional"] = "constant"
    loss: Loss = "squares"

    @property
    def is_proportional(self) -> bool:
        """Whether F_s stands for f_s = F_s/F_n."""
        return self.static == "proportional"


@dataclass(frozen=True, slots=True)
class TustinBounds:
    """The box that the fit searches, one (lower, upper) pair per parameter.

    Raises:
        SettingsError: a pair is not increasing, or v_s or delta_s is not positive.
    """

    mu: tuple[float, float] = (0.0, 10.0)
    F_s: tuple[float, float] = (0.0, 60.0)
    v_s: tuple[float, float] = (0.001, 1.0)
    delta_s: tuple[float, float] = (0.1, 20.0)
    b: tuple[float, float] = (-200.0, 200.0)

    def __post_init__(self) -> None:
        for name, (lower, upper) in self.items():
            is_positive = lower > 0 or name not in {"v_s", "delta_s"}
            if not (lower < upper and is_positive):
                raise SettingsError(
                    f"The bounds of {name} ({lower:g} to {upper:g}) are no range.",
                    hint="The lower one must be smaller; v_s and delta_s above zero.",
                )

    def items(self) -> list[tuple[str, tuple[float, float]]]:
        """Return (parameter, (lower, upper)) in parameter order."""
        return [(item.name, getattr(self, item.name)) for item in fields(self)]

    def reached(self, name: str, value: float) -> Literal["lower", "upper"] | None:
        """Return the bound that a value of parameter `name` lies on, or None."""
        edges: tuple[float, float] = getattr(self, name)
        width, is_logarithmic = edges[1] - edges[0], name in {"v_s", "delta_s"}
        for side, edge in zip(("lower", "upper"), edges, strict=True):
            if _is_at(value, edge, width, is_logarithmic):
                return side
        return None

    def box(self) -> Box:
        """Return the bounds in the form used by the search."""
        linear = np.array([self.mu, self.F_s, self.b])
        logarithmic = np.log(np.array([self.v_s, self.delta_s]))
        return Box(linear[:, 0], linear[:, 1], logarithmic)


@dataclass(frozen=True, slots=True)
class TustinFit:
    """A fitted Tustin model.

    Attributes:
        parameters: the optimum.
        sse: sum of squared residuals [N^2], unweighted.
        rows: number of samples it was fitted to.
        flags: warnings about the parameters.
        form: variant that was fitted.
        profiles: profile intervals of v_s and delta_s.
    """

    parameters: TustinParameters
    sse: float
    rows: int
    flags: tuple[str, ...]
    form: TustinForm = field(default_factory=TustinForm)
    profiles: Profiles | None = None

    def mean(self, F_n: Array, v_t: Array) -> Array:
        """Return F_t [N] of the fitted curve, shape (n,)."""
        return predict(self.parameters, F_n, v_t, self.form)

    @property
    def rmse(self) -> float:
        """Root mean square residual of the fitted samples [N]."""
        return float(np.sqrt(self.sse / self.rows))

    @property
    def residual_sd(self) -> float:
        """Standard deviation of the residual [N], corrected for five parameters."""
        freedom = max(self.rows - len(fields(TustinParameters)), 1)
        return float(np.sqrt(self.sse / freedom))


def predict(
    parameters: TustinParameters,
    F_n: Array,
    v_t: Array,
    form: TustinForm | None = None,
) -> Array:
    """Return F_t [N] of the Stribeck curve (1), odd in v_t; at standstill F_s."""
    p = parameters
    e = np.exp(-stribeck_power(np.abs(v_t), p.v_s, p.delta_s))
    sign = np.where(v_t < 0, -1.0, 1.0)
    static = _static(p, F_n, form)
    return sign * (p.mu * F_n + (static - p.mu * F_n) * e) + p.b * v_t


def bound(
    parameters: TustinParameters,
    F_n: Array,
    form: TustinForm | None = None,
    *,
    as_printed: bool = False,
) -> Array:
    """Return the largest |F_t| [N] that sticking can hold.

    With a Stribeck term that is max(F_s, mu F_n); `as_printed` gives mu F_n (eq. 2).
    """
    load = np.asarray(F_n, dtype=np.float64)
    sliding = parameters.mu * load
    return (
        sliding if as_printed else np.maximum(_static(parameters, load, form), sliding)
    )


def fit_tustin(
    F_n: Array,
    v_t: Array,
    F_t: Array,
    bounds: TustinBounds | None = None,
    form: TustinForm | None = None,
) -> TustinFit:
    """Fit the Tustin model within `bounds` by minimising the loss.

    Args:
        F_n: normal force [N], shape (n,).
        v_t: slip velocity [m/s], shape (n,), all above zero.
        F_t: traction force [N], shape (n,).
        bounds: box of the search.
        form: variant and loss; by default eq. (1) by least squares.

    Raises:
        SettingsError: fewer than 20 samples.
    """
    if F_n.size < MINIMUM_ROWS:
        raise SettingsError(
            f"{F_n.size} samples are too few for the five Tustin parameters "
            f"(at least {MINIMUM_ROWS}).",
            hint="Record more motion inside the window of velocities.",
        )
    bounds, form = bounds or TustinBounds(), form or TustinForm()
    problem = Problem(
        (F_n, v_t, F_t), bounds.box(), is_proportional=form.is_proportional
    )
    if form.loss != "squares":
        problem = weighted(problem, form.loss)
    moments = Moments.of(problem, (F_n.size,))
    optima = search(problem, moments)
    parameters = parameters_at(optima[0])
    residual = problem.residual(optima[0])
    open_intervals = profiles(moments, bounds.box(), optima[0], residual)
    return TustinFit(
        parameters=parameters,
        sse=float(residual @ residual),
        rows=F_n.size,
        flags=_flags(problem, optima[0], bounds, open_intervals),
        form=form,
        profiles=open_intervals,
    )


def parameters_at(point: Point) -> TustinParameters:
    """Convert a point of the search to parameters."""
    mu, F_s, b = (float(value) for value in point.p)
    v_s, delta_s = (float(value) for value in np.exp(point.q))
    return TustinParameters(mu=mu, F_s=F_s, v_s=v_s, delta_s=delta_s, b=b)


def _static(
    parameters: TustinParameters, F_n: Array, form: TustinForm | None
) -> Array | float:
    is_proportional = form is not None and form.is_proportional
    return parameters.F_s * F_n if is_proportional else parameters.F_s


def _flags(
    problem: Problem, point: Point, bounds: TustinBounds, intervals: Profiles
) -> tuple[str, ...]:
    parameters = parameters_at(point)
    flags = [
        f"{name} at {side} bound"
        for (name, _), value in zip(bounds.items(), astuple(parameters), strict=True)
        if (side := bounds.reached(name, value))
    ]
    flags += [
        f"{name} negative"
        for name in ("mu", "F_s", "b")
        if getattr(parameters, name) < 0
    ]
    if not (intervals.are_closed and is_identifiable(problem, point)):
        flags.append(NOT_IDENTIFIABLE)
    if is_straight(problem, point):
        flags.append(NO_STRIBECK)
    return tuple(flags)


def _is_at(value: float, edge: float, width: float, is_logarithmic: bool) -> bool:
    if is_logarithmic:
        return bool(abs(np.log(value / edge)) < _LOG_EDGE)
    return abs(value - edge) < _LINEAR_EDGE * width
