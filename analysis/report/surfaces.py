"""Mean and variance of a model over velocity and load, and sample coverage."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.data.samples import SampleTable
from analysis.data.series import Array
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

_POINTS = 41  # along each axis of a surface
_CELLS = 20  # along each axis of a coverage map
_LOAD_QUANTILE = 0.995  # quantile of F_n at which the load axis ends


@dataclass(frozen=True, slots=True)
class Surface:
    """Fitted model over (v_t, F_n) and the samples of the terrain.

    Attributes:
        terrain: name of the terrain.
        data: kept samples of the terrain.
        mean: predicted F_t [N], shape (loads, velocities).
        variance: variance of a measurement, noise included [N^2], same shape.
    """

    terrain: str
    data: SampleTable
    mean: Array
    variance: Array


@dataclass(frozen=True, slots=True)
class CoverageMap:
    """Number of kept samples of a terrain in every cell of velocity and load.

    Attributes:
        terrain: name of the terrain.
        counts: samples, shape (loads, velocities).
        outside: samples beyond the load axis.
    """

    terrain: str
    counts: Array
    outside: int


@dataclass(frozen=True, slots=True)
class SurfaceAxes:
    """Axes shared by all terrains, so that surfaces can be compared visually.

    Attributes:
        v_t: slip velocities [m/s], increasing.
        F_n: normal forces [N], increasing.
    """

    v_t: Array
    F_n: Array


def surface_axes(study: Study) -> SurfaceAxes:
    """Return the points at which surfaces are evaluated."""
    return _axes(study, _POINTS)


def cell_edges(study: Study) -> SurfaceAxes:
    """Return the edges of the cells of coverage maps."""
    return _axes(study, _CELLS + 1)


def surfaces(study: Study, model: str, axes: SurfaceAxes) -> list[Surface]:
    """Evaluate the first fold of `model` for every terrain that has it."""
    v, load = (grid.ravel() for grid in np.meshgrid(axes.v_t, axes.F_n))
    shape = (axes.F_n.size, axes.v_t.size)
    grids = []
    for result in study.terrains.values():
        folds = result.models(model)
        if folds:
            prediction = folds[0].model.predict(load, v)
            grids.append(
                Surface(
                    terrain=result.terrain,
                    data=SampleTable.of(result.trials),
                    mean=prediction.mean.reshape(shape),
                    variance=(prediction.sd**2).reshape(shape),
                )
            )
    return grids


def coverages(study: Study, edges: SurfaceAxes) -> list[CoverageMap]:
    """Return the coverage of every terrain with kept samples."""
    return [
        _coverage(result, edges) for result in study.terrains.values() if result.kept
    ]


def common_range(values: Sequence[Array]) -> tuple[float, float]:
    """Return the smallest and largest value of all arrays."""
    return min(float(v.min()) for v in values), max(float(v.max()) for v in values)


def _coverage(result: TerrainResult, edges: SurfaceAxes) -> CoverageMap:
    rows = SampleTable.of(result.trials)
    counts, *_ = np.histogram2d(rows.F_n, rows.v_t, bins=[edges.F_n, edges.v_t])
    return CoverageMap(result.terrain, counts, rows.count - int(counts.sum()))


def _axes(study: Study, count: int) -> SurfaceAxes:
    options = study.options.prepare
    loads = SampleTable.of([t for r in study.terrains.values() for t in r.trials]).F_n
    low, high = (
        (
            float(np.quantile(loads, 1.0 - _LOAD_QUANTILE)),
            float(np.quantile(loads, _LOAD_QUANTILE)),
        )
        if loads.size
        else (0.0, 1.0)
    )
    low = min(low, 0.0)
    high = max(high, low + 1e-3)
    return SurfaceAxes(
        v_t=np.linspace(options.slowest, options.fastest, count),
        F_n=np.linspace(low, high, count),
    )


_DIGITS = 5  # significant digits of surfaces in fits.json


def plain_surfaces(shown: Sequence[Surface], axes: SurfaceAxes) -> dict[str, Any]:
    """Convert the surfaces to plain values for fits.json."""
    return {
        "F_n": _short(axes.F_n),
        "v_t": _short(axes.v_t),
        "terrains": {
            s.terrain: {"mean": _short(s.mean), "variance": _short(s.variance)}
            for s in shown
        },
    }


def plain_coverage(shown: Sequence[CoverageMap], edges: SurfaceAxes) -> dict[str, Any]:
    """Convert the coverage maps to plain values for fits.json."""
    return {
        "F_n_edges": _short(edges.F_n),
        "v_t_edges": _short(edges.v_t),
        "terrains": {
            c.terrain: {"counts": c.counts.astype(int).tolist(), "beyond": c.outside}
            for c in shown
        },
    }


def _short(values: np.ndarray) -> Any:  # noqa: ANN401
    """Convert an array to nested lists with few digits."""
    if values.ndim > 1:
        return [_short(row) for row in values]
    return [float(f"{value:.{_DIGITS}g}") for value in values.tolist()]
