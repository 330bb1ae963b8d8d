"""Models over velocity at low, median and high load, one panel per terrain."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.samples import SampleTable
from analysis.data.series import Array
from analysis.report.style import (
    FORCE_LABEL,
    LOAD_LINES,
    SPEED_LABEL,
    Axes,
    Figure,
    panel_grid,
    plain,
)
from analysis.study.distribution import Distribution
from analysis.study.models import FittedModel
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

LOADS = (0.1, 0.5, 0.9)  # quantiles of F_n at which curves are drawn
BAND = (0.05, 0.5, 0.95)  # quantiles of F_t of a band
_MOST_POINTS = 1500  # samples drawn per panel
_CURVE_POINTS = 120


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves of one fitted model over v_t, with the samples of its terrain.

    Attributes:
        title: title of the terrain, with the kind.
        terrain: name of the terrain.
        kind: kind of the terrain.
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
        """Return the index of the nearest of the three loads of every sample, (n,)."""
        return np.argmin(np.abs(self.data.F_n[:, None] - self.loads), axis=1)


def panels(study: Study, model: str) -> list[Panel]:
    """Compute the curves of the first fold of `model` for every terrain with it."""
    return [
        _panel(result, model)
        for result in study.terrains.values()
        if result.models(model)
    ]


def force_range(panels: Sequence[Panel]) -> tuple[float, float]:
    """Return axis limits of F_t [N] for all panels that include nearly all samples."""
    low = min(float(np.quantile(panel.data.F_t, 0.005)) for panel in panels)
    high = max(float(np.quantile(panel.data.F_t, 0.995)) for panel in panels)
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _panel(result: TerrainResult, model: str) -> Panel:
    fold = next(fold for fold in result.folds if model in fold.models)
    samples = SampleTable.of(result.trials)
    step = max(1, -(-samples.count // _MOST_POINTS))
    loads = np.quantile(samples.F_n, LOADS)
    span = float(samples.v_t.min()), float(samples.v_t.max())
    # dense at low speed, where models curve, and fine enough at high speed
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


def draw_panels(
    chosen: list[Panel], draw: Callable[[Axes, Panel], None]
) -> Figure | None:
    """Draw a figure with one panel per model; None without any."""
    if not chosen:
        return None
    figure, axes = panel_grid(len(chosen), 2.1)
    for ax, panel in zip(axes, chosen, strict=True):
        draw(ax, panel)
        ax.set_title(plain(panel.title), loc="left")
    axes[0].set_ylim(*force_range(chosen))
    axes[0].set_xlim(0.0, max(float(panel.v.max()) for panel in chosen))
    figure.supxlabel(SPEED_LABEL, fontsize=8)
    figure.supylabel(FORCE_LABEL, fontsize=8)
    handles, labels = axes[0].get_legend_handles_labels()
    columns = len(labels) if len(chosen) > 1 or len(labels) < 4 else 2
    figure.legend(
        handles, labels, loc="outside upper center", ncols=columns, markerscale=3
    )
    return figure


def draw_curves(ax: Axes, panel: Panel) -> None:
    """Draw the samples and the mean at low, median and high load."""
    nearest = panel.nearest_load()
    for k, (_, colour, _) in enumerate(LOAD_LINES):
        is_nearest = nearest == k
        ax.plot(
            panel.data.v_t[is_nearest],
            panel.data.F_t[is_nearest],
            ".",
            ms=2.4,
            color=colour,
            alpha=0.35,
            mew=0,
        )
    for k, (name, colour, style) in enumerate(LOAD_LINES):
        label = f"{name} $F_n$"
        ax.plot(panel.v, panel.means[k], style, color=colour, lw=1.6, label=label)
    note_loads(ax, panel.loads)


def draw_quantiles(ax: Axes, panel: Panel) -> None:
    """Draw the samples and the quantiles of F_t at the median load."""
    _draw_samples(ax, panel)
    low, middle, high = panel.band
    ax.fill_between(
        panel.v, low, high, color="#56B4E9", alpha=0.4, lw=0, label="5 to 95%"
    )
    ax.plot(panel.v, middle, color="#0072B2", lw=1.8, label="median")
    note_loads(ax, panel.loads[1:2])


def draw_band(ax: Axes, panel: Panel) -> None:
    """Draw the samples and the mean with a band at the median load."""
    _draw_samples(ax, panel)
    mean, sd = panel.means[1], panel.sds[1]
    ax.fill_between(
        panel.v,
        mean - 2 * sd,
        mean + 2 * sd,
        color="#E69F00",
        alpha=0.35,
        lw=0,
        label=r"$\pm 2\sigma$ at median $F_n$",
    )
    for k, (name, colour, style) in enumerate(LOAD_LINES):
        width = 1.8 if k == 1 else 1.0
        label = f"mean, {name} $F_n$"
        ax.plot(panel.v, panel.means[k], style, color=colour, lw=width, label=label)
    note_loads(ax, panel.loads)


def _draw_samples(ax: Axes, panel: Panel) -> None:
    ax.axhline(0.0, color="black", lw=0.7, ls=":")
    style = {"ms": 2.4, "color": "#808080", "alpha": 0.3, "mew": 0}
    ax.plot(panel.data.v_t, panel.data.F_t, ".", label="samples", **style)


def note_loads(ax: Axes, drawn: Array) -> None:
    """Annotate the loads of the curves."""
    loads = " / ".join(f"{load:.1f}" for load in drawn)
    ax.text(
        0.97,
        0.95,
        f"$F_n$ {loads} N",
        transform=ax.transAxes,
        ha="right",
        va="top",
        fontsize=7,
        bbox={"facecolor": "white", "alpha": 0.7, "lw": 0, "pad": 1.0},
    )


def describe_curve(panel: Panel) -> str:
    """Describe the ends of the curve at the median load."""
    start, end = panel.means[1][[0, -1]]
    return (
        f"F_t goes from {start:.1f} N at {panel.v[0]:.3f} m/s to {end:.1f} N at "
        f"{panel.v[-1]:.3f} m/s on {panel.terrain}"
    )


def one_per_kind(chosen: Sequence[Panel]) -> list[Panel]:
    """Return the first panel of every kind of terrain."""
    first: dict[str, Panel] = {}
    for panel in chosen:
        first.setdefault(panel.kind, panel)
    return list(first.values())
