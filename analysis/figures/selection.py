"""What the figures show, chosen and computed without drawing anything."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.data.events import Slip
from analysis.data.prepare import Smoothed
from analysis.data.samples import SampleTable
from analysis.data.series import Array
from analysis.study.distribution import Distribution
from analysis.study.models import FittedModel
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

WINDOW = 3.5  # s shown of a trial
LOADS = (0.1, 0.5, 0.9)  # quantiles of F_n at which curves are drawn
BAND = (0.05, 0.5, 0.95)  # quantiles of F_t that make a band

_MOST_POINTS = 1500  # drawn per panel
_CURVE_POINTS = 120
_STEP = 0.1  # s between the windows compared
_ENOUGH_BOUNCES = 2
_MOST_KINDS = 4  # shown, a terrain of each
_BEFORE, _AFTER = 0.3, 0.6  # s around a slip that a window should hold


@dataclass(frozen=True, slots=True)
class TimeWindow:
    """A stretch of one trial.

    Attributes:
        title: of its terrain, with the kind.
        terrain: its terrain.
        trial: number of the trial, from 1.
        t: time from the start of the window [s], shape (n,).
        v_t: smoothed velocity [m/s], shape (n,).
        F_t: smoothed traction force [N], shape (n,).
        slips: the slips inside, times from the start of the window.
    """

    title: str
    terrain: str
    trial: int
    t: Array
    v_t: Array
    F_t: Array
    slips: tuple[Slip, ...]


@dataclass(frozen=True, slots=True)
class Panel:
    """One fitted model with its terrain's samples, for curves over v_t.

    Attributes:
        title: of its terrain, with the kind.
        terrain: its terrain.
        kind: of its terrain.
        fold: number of the fold drawn, from 1.
        data: samples of the terrain, thinned evenly for drawing.
        v: velocities of the curves [m/s], shape (m,).
        loads: low, median and high F_n [N] at which curves are drawn.
        means: predicted F_t [N], shape (3, m).
        sds: standard deviations [N], noise included, shape (3, m).
        band: quantiles of F_t at the median load [N], 5, 50 and 95 %, shape (3, m).
    """

    title: str
    terrain: str
    kind: str
    fold: int
    data: SampleTable
    v: Array
    loads: Array
    means: Array
    sds: Array
    band: Array

    def nearest_load(self) -> Array:
        """Return for every sample which of the three loads is nearest, shape (n,)."""
        return np.argmin(np.abs(self.data.F_n[:, None] - self.loads), axis=1)


def representatives(study: Study) -> list[TerrainResult]:
    """Return the first terrain of every kind that has kept samples."""
    first: dict[str, TerrainResult] = {}
    for result in study.terrains.values():
        if result.kept:
            first.setdefault(result.kind, result)
    return list(first.values())[:_MOST_KINDS]


def time_windows(study: Study) -> list[TimeWindow]:
    """Return the stretch to show of one terrain per kind."""
    return [busiest_window(result) for result in representatives(study)]


def busiest_window(result: TerrainResult) -> TimeWindow:
    """Return the stretch that shows most: bounce-backs, then slips, then motion.

    Two bounce-backs are enough, as in the paper's figure.
    """
    candidates = [
        (_events_and_motion(trial.smooth, slips, start), k, start)
        for k, (trial, slips) in enumerate(
            zip(result.trials, result.slips, strict=True)
        )
        for start in _starts(trial.smooth)
    ]
    _, k, start = max(candidates)
    smooth = result.trials[k].smooth
    rows = (smooth.t >= start) & (smooth.t <= start + WINDOW)
    return TimeWindow(
        title=result.title,
        terrain=result.terrain,
        trial=k + 1,
        t=smooth.t[rows] - start,
        v_t=smooth.v_t[rows],
        F_t=smooth.F_t[rows],
        slips=tuple(
            replace(slip, onset=slip.onset - start, end=slip.end - start)
            for slip in result.slips[k]
            if _is_inside(slip, start)
        ),
    )


def panels(study: Study, model: str) -> list[Panel]:
    """Return the curves of the first fold of `model` for every terrain that has one."""
    return [
        _panel(result, model)
        for result in study.terrains.values()
        if result.models(model)
    ]


def force_range(panels: Sequence[Panel]) -> tuple[float, float]:
    """Return limits of F_t [N] that suit all panels: nearly all samples, all curves."""
    low = min(float(np.quantile(panel.data.F_t, 0.005)) for panel in panels)
    high = max(float(np.quantile(panel.data.F_t, 0.995)) for panel in panels)
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _starts(smooth: Smoothed) -> Array:
    """Return starts a step apart, where there are samples."""
    first = float(smooth.t[0])
    last = max(float(smooth.t[-1]) - WINDOW, first)
    starts = first + np.unique(np.floor((smooth.t - first) / _STEP)) * _STEP
    return starts[starts < last + _STEP / 2]


def _is_inside(slip: Slip, start: float) -> bool:
    return start + _BEFORE <= slip.onset and slip.end + _AFTER <= start + WINDOW


def _events_and_motion(
    smooth: Smoothed, slips: Sequence[Slip], start: float
) -> tuple[int, int, float]:
    inside = [slip for slip in slips if _is_inside(slip, start)]
    rows = slice(*np.searchsorted(smooth.t, [start, start + WINDOW]))
    moving = float(np.mean(smooth.v_t[rows] > 0)) if rows.stop > rows.start else 0.0
    bounced = sum(slip.has_bounce for slip in inside)
    return min(bounced, _ENOUGH_BOUNCES), len(inside), moving


def _panel(result: TerrainResult, model: str) -> Panel:
    fold = next(fold for fold in result.folds if model in fold.models)
    samples = SampleTable.of(result.trials)
    step = max(1, -(-samples.count // _MOST_POINTS))
    loads = np.quantile(samples.F_n, LOADS)
    span = float(samples.v_t.min()), float(samples.v_t.max())
    # dense at the slow end, where models bend, and fine enough at the fast one
    v = np.union1d(
        np.geomspace(*span, _CURVE_POINTS), np.linspace(*span, _CURVE_POINTS)
    )
    curves = [_curve(fold.models[model].model, load, v) for load in loads]
    return Panel(
        title=result.title,
        terrain=result.terrain,
        kind=result.kind,
        fold=fold.fold + 1,
        data=samples.take(np.arange(0, samples.count, step)),
        v=v,
        loads=loads,
        means=np.array([curve.mean for curve in curves]),
        sds=np.array([curve.sd for curve in curves]),
        band=curves[1].quantiles(BAND),
    )


def _curve(model: FittedModel, load: float, v: Array) -> Distribution:
    return model.predict(np.full(v.shape, load), v)
