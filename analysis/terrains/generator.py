"""A ground that can be sampled: F_t along a motion, as a trial to come would show it.

A mixture of linear experts for the next force (Jacobs et al. 1991; in time Weigend,
Mangeas and Srivastava 1995). With F the force less the level of the trial, D its last
increment, f = F_n, v = v_t, v+ = max(v, 0), v- = min(v, 0), m the median of a new trial
at (f, v), w a mean of v over the last 50 ms and ' for the new sample, one step of 10 ms
is

    w' = w + 0.2 (v' - w)
    x  = (1, F, D, F v'+, F w', f', f' - f, v'+, v'-, v' - v, v, w', m', m' - m)
    g  = (x, F / max(f', 0.8), F s, s),   s = min(|v'| / 0.02, 1)
    g  = 1 for its first number, else clip((g - centre) / scale, -4, 4)
    k  : the first expert with  sum_{j <= k} softmax(W g)_j > u,   u ~ U(0, 1)
    F' = F + a (b_k . x + drift(v') + s_k z),                      z ~ N(0, 1)
    a  = min(max((h' - 0.002) / 0.004, 0), 1),   h' = h + 0.02 (|w'| - h)
    F' = F' - pull(v') (F' - m')                  0.01 at |v'| < 0.008 m/s, else 0.003
    F' = F' - 0.1 (F' - min(max(F', low'), high'))
    F' = min(max(F', least), most),   D' = F' - F

low and high are what a new trial does not reach with -2 and +2 sd; drift is linear
between its knots and constant beyond. m, low, high are bilinear in a table and those of
its edge beyond. What is returned is F' plus the level of the trial,

    level = sc n sqrt((J - 1) / c),   n ~ N(0, 1),  c ~ chi^2 of J - 1 (4 at least).

A foot that has stood still for longer than a second keeps its force (a = 0), but for
the pull: no motion tells it, and no trial that was learnt from may have had it.
A path begins at m, half a second before its first sample, on a motion that is held.
v_t of a record tells when the ground gave way: a sample is a possible F_t for this
motion, no forecast of a planned one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from acquisition.errors import SettingsError
from acquisition.validation import Many
from analysis.data.series import Array
from analysis.study.distribution import FEWEST
from analysis.terrains.process_rows import STEP
from analysis.terrains.table import Table

FEATURES, GATES = 14, 17
KNOTS = (-0.03, -0.004, 0.0, 0.004, 0.012, 0.03, 0.07, 0.13, 0.22)  # m/s, of the drift
EDGES = 2.0  # sd from the median to low and high
MOST_EXPERTS = 16
BEFORE = 50  # samples that a path goes before its first one
MOST_STEPS = 30_000_000  # samples of all paths together

_MOST_POINTS = 100  # of an axis of the bands
_BLOCK = 256  # samples that are laid out for all paths at a time
_LEAST_LOAD, _FULL = 0.8, 0.02  # N and m/s of the gate
_CLIPPED = 4.0
_SLOW, _PULL, _SLOW_PULL, _WALL, _FLOOR = 0.008, 0.003, 0.01, 0.1, 0.5
_FORGOTTEN = 0.2  # of the mean velocity in a step
_STOOD, _STILL = 0.02, (0.002, 0.004)  # of the mean speed in a step; m/s
_OF_F = (1, 2, 3, 4, 14, 15)  # numbers of g that depend on F: those of x, then the rest


class Experts(NamedTuple):
    """What the mixture is made of.

    Attributes:
        weights: b of every expert, shape (K, 14).
        sd: s of every expert [N], shape (K,).
        gate: W, shape (K, 17).
        centre: of the gate's numbers, shape (17,); the first is not used.
        scale: of the gate's numbers, shape (17,).
    """

    weights: Array
    sd: Array
    gate: Array
    centre: Array
    scale: Array


@dataclass(frozen=True, slots=True)
class SampledTraction:
    """Forces that a new trial may show along a motion.

    Attributes:
        forces: F_t [N] of n paths, shape (n, T).
        is_extrapolated: at which samples load or velocity lie outside of what was
            recorded, shape (T,).
    """

    forces: Array
    is_extrapolated: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Generator:
    """F_t of a terrain along F_n and v_t; its equations stand above.

    Attributes:
        experts: the mixture; a single one is linear.
        drift: at the knots [N], shape (9,).
        bands: low, median and high of a new trial.
        between: spread between trials, sc [N].
        trials: J that it was fitted to.
        least: smallest F [N],
        most: and largest.
    """

    experts: Experts
    drift: Array
    bands: Table
    between: float
    trials: int
    least: float
    most: float

    def to_dict(self) -> dict[str, Any]:
        """Return the generator as plain values, for JSON."""
        bands = self.bands
        return {
            "step_ms": round(1000.0 * STEP),
            "trials": self.trials,
            "between": self.between,
            "range": [self.least, self.most],
            "drift": self.drift.tolist(),
            "weights": self.experts.weights.tolist(),
            "sd": self.experts.sd.tolist(),
            "gate": self.experts.gate.tolist(),
            "centre": self.experts.centre.tolist(),
            "scale": self.experts.scale.tolist(),
            "bands": {
                "F_n": bands.F_n,
                "v_t": bands.v_t,
                "shares": bands.shares,
                "forces": bands.forces,
            },
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "Generator":
        """Return the generator of plain values.

        Raises:
            ValueError: a value is missing or not what it should be.
        """
        stored = _StoredGenerator.model_validate(content)
        experts = Experts(*(np.array(getattr(stored, n)) for n in Experts._fields))
        shapes = {name: getattr(experts, name).shape for name in Experts._fields}
        K = len(experts.sd)
        if shapes != {
            "weights": (K, FEATURES),
            "sd": (K,),
            "gate": (K, GATES),
            "centre": (GATES,),
            "scale": (GATES,),
        }:
            raise ValueError(f"its {K} experts do not have {FEATURES}, {GATES} numbers")
        least, most = stored.range
        if least >= most:
            raise ValueError("its range is empty")
        return cls(
            experts=experts,
            drift=np.array(stored.drift),
            bands=stored.bands.table(),
            between=stored.between,
            trials=stored.trials,
            least=least,
            most=most,
        )

    @property
    def size(self) -> int:
        """Number of experts."""
        return len(self.experts.sd)

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the spread between trials."""
        return max(self.trials - 1, FEWEST)

    def sample(
        self, F_n: Array, v_t: Array, seed: int, paths: int = 1
    ) -> SampledTraction:
        """Return possible forces along a motion; the same for the same seed.

        Path k is the same however many there are.

        Args:
            F_n: normal force [N] every 10 ms, shape (T,).
            v_t: velocity [m/s], shape (T,).
            seed: of the draws, not negative.
            paths: how many.

        Raises:
            SettingsError: no motion, one that is not finite, or too many samples.
        """
        _check_motion(F_n, v_t, seed, paths)
        draws = Draws.of(seed, paths, F_n.size, self.trials)
        (forces,) = self.run([(F_n, v_t)], draws)
        return SampledTraction(forces, ~self.bands.covers_many(F_n, v_t))

    def run(
        self, motions: Sequence[tuple[Array, Array]], draws: "Draws"
    ) -> list[Array]:
        """Return possible forces along motions, each (n / number of motions, T).

        Args:
            motions: F_n [N] and v_t [m/s] of each, shape (T,).
            draws: of n paths, a group of the same size for every motion.
        """
        begun = []
        for F_n, v_t in motions:
            rows = np.concatenate([np.zeros(BEFORE, dtype=int), np.arange(F_n.size)])
            begun.append(Motion.of(F_n[rows], v_t[rows], self.bands))
        levels = np.split(self.between * draws.level[:, None], len(motions))
        found = self.along(begun, draws)
        return [F[:, BEFORE:] + u for F, u in zip(found, levels, strict=True)]

    def along(self, motions: Sequence["Motion"], draws: "Draws") -> list[Array]:
        """Return F along motions, each (n / number of motions, T) from its first on.

        Args:
            motions: of any length.
            draws: of n paths, a group of the same size for every motion.
        """
        count = draws.uniform.shape[0] // len(motions)
        longest = max(motion.m.size for motion in motions)
        parts = [_Prepared.of(self, motion, longest) for motion in motions]
        steps = _Prepared.joined(parts)
        gate, uniform, normal = _Gate.of(self.experts), draws.uniform.T, draws.normal.T
        slopes = self.experts.weights[:, _OF_F[:4]].T.copy()
        found = np.empty((longest, draws.uniform.shape[0]))
        each = np.arange(draws.uniform.shape[0])
        F = found[0] = np.repeat(steps.m[0], count)
        of_F = np.zeros((len(_OF_F), F.size))  # F, D and what F is multiplied with
        for begin in range(1, longest, _BLOCK):
            block = steps.block(begin, count)
            for i in range(begin, min(begin + _BLOCK, longest)):
                row = i - begin
                of_F[0] = F
                np.multiply(F, block.factors[row], out=of_F[2:])
                k = gate.choose(of_F, block.logits[row], uniform[i - 1])
                step = block.mean[row, k, each] + self.experts.sd[k] * normal[i - 1]
                step = step + np.add.reduce(of_F[:4] * slopes[:, k])
                new, m = F + block.fade[row] * step, block.m[row]
                new = new - block.pull[row] * (new - m)
                new = new - _FLOOR * np.minimum(new - block.low[row], 0.0)
                new = new - _WALL * np.maximum(new - block.high[row], 0.0)
                new = np.minimum(np.maximum(new, self.least), self.most)
                of_F[1] = new - F
                F = found[i] = new
        runs = np.split(found.T, len(motions))
        return [
            run[:, : motion.m.size] for run, motion in zip(runs, motions, strict=True)
        ]


_Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e6, le=1e6)]
_Positive = Annotated[float, Field(strict=True, gt=0.0, le=1e6)]
_Several = Annotated[Many[Many[_Number]], Field(min_length=1, max_length=MOST_EXPERTS)]


class _StoredBands(BaseModel):
    """Bands as they are stored."""

    model_config = ConfigDict(extra="forbid")

    F_n: Annotated[Many[_Number], Field(min_length=2, max_length=_MOST_POINTS)]
    v_t: Annotated[Many[_Number], Field(min_length=2, max_length=_MOST_POINTS)]
    shares: Annotated[Many[_Number], Field(min_length=3, max_length=3)]
    forces: Annotated[Many[Many[Many[_Number]]], Field(min_length=3, max_length=3)]

    def table(self) -> Table:
        """Return the table.

        Raises:
            ValueError: it is none.
        """
        forces = np.array(self.forces)
        if forces.shape != (3, len(self.F_n), len(self.v_t)):
            raise ValueError("its bands do not have the size of their axes")
        if any((np.diff(axis) <= 0.0).any() for axis in (self.F_n, self.v_t)):
            raise ValueError("an axis of its bands does not increase")
        if (np.diff(forces, axis=0) < 0.0).any():
            raise ValueError("its bands cross")
        return Table(self.F_n, self.v_t, self.shares, self.forces)


class _StoredGenerator(BaseModel):
    """A generator as it is stored."""

    model_config = ConfigDict(extra="forbid")

    step_ms: Literal[10]
    trials: Annotated[int, Field(strict=True, ge=2, le=1_000_000)]
    between: Annotated[float, Field(strict=True, ge=0.0, le=1e6)]
    range: tuple[_Number, _Number]
    drift: Annotated[Many[_Number], Field(min_length=9, max_length=9)]
    weights: _Several
    sd: Annotated[Many[_Positive], Field(min_length=1, max_length=MOST_EXPERTS)]
    gate: _Several
    centre: Many[_Number]
    scale: Many[_Positive]
    bands: _StoredBands


class Draws(NamedTuple):
    """Random numbers of n paths, each path by a stream of its own.

    Attributes:
        uniform: shape (n, T).
        normal: shape (n, T).
        level: of the trial in units of sc, shape (n,).
    """

    uniform: Array
    normal: Array
    level: Array

    @classmethod
    def of(cls, seed: int, paths: int, steps: int, trials: int) -> "Draws":
        """Return the draws of paths of so many samples."""
        length = steps + BEFORE
        uniform, normal = np.empty((paths, length)), np.empty((paths, length))
        level, freedom = np.empty(paths), max(trials - 1, FEWEST)
        for k in range(paths):
            rng = np.random.default_rng((seed, k))
            level[k] = rng.standard_normal() * np.sqrt(freedom / rng.chisquare(freedom))
            uniform[k], normal[k] = rng.random(length), rng.standard_normal(length)
        return cls(uniform, normal, level)


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A motion and what a new trial gives on it, each of shape (T,).

    Attributes:
        F_n: normal force [N].
        v_t: velocity [m/s].
        low: force [N] that is reached but for -2 sd.
        m: median force [N].
        high: force [N] that is not reached but for +2 sd.
        factors: what F is multiplied with: v+, w, 1 / max(f, 0.8) and s, shape (T, 4).
        fade: a: 1 in motion, 0 when the foot has stood still for long.
    """

    F_n: Array
    v_t: Array
    low: Array
    m: Array
    high: Array
    factors: Array
    fade: Array

    @classmethod
    def of(cls, F_n: Array, v_t: Array, bands: Table) -> "Motion":
        """Return a motion with its bands."""
        w = _running_mean(v_t, _FORGOTTEN)
        over_load = 1.0 / np.maximum(F_n, _LEAST_LOAD)
        share = np.minimum(np.abs(v_t) / _FULL, 1.0)
        factors = np.column_stack([np.maximum(v_t, 0.0), w, over_load, share])
        recent = _running_mean(np.abs(w), _STOOD)
        fade = np.clip((recent - _STILL[0]) / _STILL[1], 0.0, 1.0)
        low, m, high = bands.over(F_n, v_t)
        return cls(F_n, v_t, low, m, high, factors, fade)

    def features(self, F: Array, D: Array) -> Array:
        """Return x of every sample but the first, shape (T - 1, 14).

        Args:
            F: force less the level of the trial [N], before the step, shape (T - 1,).
            D: its last increment [N], shape (T - 1,).
        """
        f, v, m, factors = self.F_n, self.v_t, self.m, self.factors[1:]
        forward, backward = np.maximum(v[1:], 0.0), np.minimum(v[1:], 0.0)
        of_F = (F, D, F * factors[:, 0], F * factors[:, 1])
        of_motion = (f[1:], np.diff(f), forward, backward, np.diff(v), v[:-1])
        more = (factors[:, 1], m[1:], np.diff(m))
        return np.column_stack([np.ones(F.size), *of_F, *of_motion, *more])

    def gates(self, x: Array) -> Array:
        """Return g of every sample but the first, not scaled, shape (T - 1, 17)."""
        F, share = x[:, 1, None], self.factors[1:, 3:]
        return np.column_stack([x, F * self.factors[1:, 2:], share])


def _running_mean(values: Array, share: float) -> Array:
    """Return the mean of what came before, of which a share is forgotten, (T,)."""
    found = np.empty(values.size)
    mean = found[0] = values[0]
    for i, value in enumerate(values[1:].tolist(), 1):
        mean = found[i] = mean + share * (value - mean)
    return found


def scaled_gates(gates: Array, experts: Experts) -> Array:
    """Return g as the gate takes it, shape (n, 17)."""
    scaled = (gates - experts.centre) / experts.scale
    scaled = np.minimum(np.maximum(scaled, -_CLIPPED), _CLIPPED)
    scaled[:, 0] = 1.0
    return scaled


class _Gate(NamedTuple):
    """What chooses among experts, by those numbers of g that depend on F.

    Attributes:
        weights: of those numbers, shape (6, K, 1).
        centre: of them, shape (6, 1).
        scale: of them, shape (6, 1).
    """

    weights: Array
    centre: Array
    scale: Array

    @classmethod
    def of(cls, experts: Experts) -> "_Gate":
        """Return the gate of a mixture."""
        of_F = list(_OF_F)
        return cls(
            experts.gate[:, of_F].T[:, :, None],
            experts.centre[of_F, None],
            experts.scale[of_F, None],
        )

    def choose(self, of_F: Array, logits: Array, uniform: Array) -> NDArray[np.intp]:
        """Return the expert of every path, shape (n,).

        Args:
            of_F: numbers of g that depend on F, shape (6, n).
            logits: what the others give, shape (K, n).
            uniform: the draws, shape (n,).
        """
        if len(logits) == 1:  # a single expert is not chosen
            return np.zeros(uniform.size, dtype=np.intp)
        scaled = (of_F - self.centre) / self.scale
        scaled = np.minimum(np.maximum(scaled, -_CLIPPED), _CLIPPED)
        # summed number by number: a product of matrices depends on how many paths
        logits = logits + np.add.reduce(scaled[:, None] * self.weights)
        shares = np.exp(logits - np.maximum.reduce(logits))
        shares = np.add.accumulate(shares)
        return np.add.reduce(shares <= uniform * shares[-1], dtype=np.intp)


class _Prepared(NamedTuple):
    """What of the steps does not depend on F: by sample, number or expert, motion."""

    m: Array
    low: Array
    high: Array
    factors: Array
    pull: Array
    fade: Array
    mean: Array
    logits: Array

    @classmethod
    def of(cls, generator: Generator, motion: Motion, length: int) -> "_Prepared":
        experts, zero = generator.experts, np.zeros(motion.m.size - 1)
        x = motion.features(zero, zero)
        g = scaled_gates(motion.gates(x), experts)
        g[:, _OF_F] = 0.0  # those of F and D are added step by step
        drift = np.interp(motion.v_t, KNOTS, generator.drift)
        first = ((1, 0), (0, 0))
        columns = (
            *(motion.m, motion.low, motion.high, motion.factors),
            np.where(np.abs(motion.v_t) < _SLOW, _SLOW_PULL, _PULL),
            motion.fade,
            np.pad(np.einsum("ti,ki->tk", x, experts.weights), first) + drift[:, None],
            np.pad(np.einsum("ti,ki->tk", g, experts.gate), first),
        )
        missing = length - motion.m.size
        return cls(
            *(np.pad(c, ((0, missing),) + ((0, 0),) * (c.ndim - 1)) for c in columns)
        )

    def block(self, begin: int, count: int) -> "_Prepared":
        """Return some samples from `begin` on, every motion repeated for its paths."""
        rows = slice(begin, begin + _BLOCK)
        return _Prepared(*(np.repeat(c[rows], count, axis=-1) for c in self))

    @classmethod
    def joined(cls, parts: Sequence["_Prepared"]) -> "_Prepared":
        """Return all of them, with the number of the motion last."""
        return cls(*(np.stack(column, axis=-1) for column in zip(*parts, strict=True)))


def _check_motion(F_n: Array, v_t: Array, seed: int, paths: int) -> None:
    is_line = F_n.ndim == 1 and F_n.shape == v_t.shape and F_n.size >= 2
    if not is_line or not (np.isfinite(F_n).all() and np.isfinite(v_t).all()):
        raise SettingsError(
            f"No motion to sample along: F_n {F_n.shape}, v_t {v_t.shape}.",
            hint="Give both every 10 ms, two samples or more, finite, in two arrays of "
            "the same length.",
        )
    for name, number in (("seed", seed), ("n", paths)):
        if isinstance(number, bool) or not isinstance(number, Integral):
            raise SettingsError(
                f"{name} = {number!r} is no whole number.",
                hint="Write e.g. seed=1, n=5.",
            )
    if seed < 0 or paths < 1 or paths * F_n.size > MOST_STEPS:
        raise SettingsError(
            f"{paths} paths of {F_n.size} samples, seed {seed}: they cannot be drawn.",
            hint="Give a seed of 0 or more, one path at least, and at most "
            f"{MOST_STEPS:,} samples in all.",
        )
