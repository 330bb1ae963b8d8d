"""The cells of a matrix by the model of all ground: forecasts, and which comes next.

A cell that was never recorded is forecast from those that were, as a new trial on it.
Of every cell it is computed how much one more trial there would raise the expected log
density of measurements in all of them: the gain of information that Krause, Singh and
Guestrin (2008, J. Mach. Learn. Res. 9, 235-284) place sensors by, weighted by what a
forecast is judged by. A trial tells the level of its ground but for the spread between
trials and a residual that remembers, as `_PER_TRIAL` independent rows would.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.samples import SampleTable
from analysis.data.series import Array
from analysis.gp.ground import Ground, left_out
from analysis.study.all_ground import AllGroundModel, TerrainRows, fit_all_ground

ENOUGH = 0.002  # nat per measurement, below which a further trial is not worth it
_PER_TRIAL = 10.0  # independent rows that a trial is worth
_BAND = (0.05, 0.5, 0.95)
_FEWEST = 2  # terrains that a model of all ground is fitted to


@dataclass(frozen=True, slots=True)
class CellForecast:
    """One cell at the median load and velocity of the study.

    Attributes:
        terrain: its name.
        trials: how many were recorded.
        low: 5 % quantile of a measurement of a new trial [N].
        middle: its median [N].
        high: 95 % quantile [N].
        beyond: names of what lies outside of what was recorded; () = nothing.
        gain: what one more trial here is expected to bring, mean over all cells [nat
            per measurement].
    """

    terrain: str
    trials: int
    low: float
    middle: float
    high: float
    beyond: tuple[str, ...]
    gain: float


@dataclass(frozen=True, slots=True)
class MatrixForecast:
    """All cells of a matrix.

    Attributes:
        F_n: load that they are forecast at [N].
        v_t: velocity that they are forecast at [m/s].
        cells: in the order of the matrix.
        left_out: factors that the model does not take, beyond its six.
    """

    F_n: float
    v_t: float
    cells: tuple[CellForecast, ...]
    left_out: tuple[str, ...]

    @property
    def best(self) -> CellForecast:
        """The cell where one more trial is expected to bring most."""
        return max(self.cells, key=lambda cell: cell.gain)

    @property
    def is_enough(self) -> bool:
        """Whether every cell was recorded and no further trial is worth it."""
        every = all(cell.trials for cell in self.cells)
        return every and self.best.gain < ENOUGH


def forecast_matrix(
    trials: Mapping[str, Sequence[PreparedTrial]],
    recorded: Mapping[str, Ground],
    cells: Sequence[Ground],
) -> MatrixForecast | None:
    """Return forecasts of all cells; None where fewer than two grounds are known.

    Args:
        trials: prepared trials by terrain.
        recorded: grounds of the terrains that were recorded, by name.
        cells: grounds of the matrix.

    Raises:
        SettingsError: the model cannot be fitted.
    """
    known = [
        TerrainRows(ground, tables)
        for name, ground in recorded.items()
        if (tables := tuple(SampleTable.of([t]) for t in trials[name] if t.kept))
    ]
    if len(known) < _FEWEST or not cells:
        return None
    rows = SampleTable.joined([table for each in known for table in each.trials])
    point = np.median(rows.inputs, axis=0)[None, :]
    model = fit_all_ground(known)
    grounds = [each.ground for each in known]
    gains = _gains(model, cells, point)
    forecasts: list[CellForecast] = []
    for ground, gain in zip(cells, gains, strict=True):
        low, middle, high = model.predict(ground, point).quantiles(_BAND)[:, 0]
        forecasts.append(
            CellForecast(
                terrain=ground.terrain,
                trials=len(trials.get(ground.terrain, ())),
                low=float(low),
                middle=float(middle),
                high=float(high),
                beyond=beyond_recorded(ground, grounds),
                gain=float(gain),
            )
        )
    load, speed = point[0].tolist()
    return MatrixForecast(load, speed, tuple(forecasts), left_out(grounds))


def beyond_recorded(ground: Ground, recorded: Sequence[Ground]) -> tuple[str, ...]:
    """Return what of a ground lies outside of what was recorded on its class.

    A number below the smallest or above the largest, a word that none has; for ground
    that was recorded itself nothing.
    """
    if any(each.terrain == ground.terrain for each in recorded):
        return ()
    alike = [each for each in recorded if each.is_plate == ground.is_plate]
    if not alike:
        return ("ground",)
    found: list[str] = []
    numbers = {
        "incline_deg": [each.incline_deg for each in alike],
        "d50": [] if ground.is_plate else [each.log_size for each in alike],
    }
    own = {"incline_deg": ground.incline_deg, "d50": ground.log_size}
    for name, value in ground.factors:
        stated = [each.value(name) for each in alike]
        if isinstance(value, float):
            numbers[name] = [v for v in stated if isinstance(v, float)]
            own[name] = value
        elif value not in stated:
            found.append(name)
    found += [
        name
        for name, values in numbers.items()
        if values and not min(values) <= own[name] <= max(values)
    ]
    return tuple(sorted(found))


def _gains(model: AllGroundModel, cells: Sequence[Ground], point: Array) -> Array:
    """Return the mean gain of one more trial on each cell [nat], shape (k,).

    Args:
        model: of all ground.
        cells: k grounds.
        point: F_n [N] and v_t [m/s], shape (1, 2).
    """
    C = model.given.covariance(cells, point)
    spread = [model.given.predict(cell, point) for cell in cells]
    between = np.array([each.between for each in spread])
    noise = np.array([each.noise for each in spread])
    latent = np.maximum(np.diagonal(C), 0.0)
    told = latent + between + noise / _PER_TRIAL
    after = latent[None, :] - C**2 / told[:, None]  # (trial on, cell)
    total = between + noise
    ratio = (latent + total)[None, :] / (np.maximum(after, 0.0) + total[None, :])
    return 0.5 * np.log(ratio).mean(axis=1)
