"""One model for all ground: terrains share a form, each deviates, so does each trial.

The hierarchical process (`analysis.gp.hierarchy`) of the warped force z = c log(y + c),
over the stones and plates of a study; c is the likeliest of four for all of them.
Hyperparameters come from 60 rows of every terrain, predictions from 300 of each: 2,400
rows for eight terrains are factorised exactly.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from analysis.data.samples import SampleTable
from analysis.data.series import Array
from analysis.gp.ground import Ground, GroundRows
from analysis.gp.hierarchy import (
    GroundPosterior,
    GroundPrediction,
    GroundProcess,
    PredictiveProcess,
    in_unit,
)
from analysis.study.distribution import FEWEST, NewTrialPrediction
from analysis.study.skew import (
    ShapeMap,
    bends_for,
    choose_shape,
    log_warp_slope,
    warped,
)

GIVEN = 300  # rows of a terrain that predictions are made from
_TUNED = 60  # rows of a terrain that hyperparameters come from
_BENDS = (3.0, 1.0, 9.0, None)  # N, c of the warp


@dataclass(frozen=True, slots=True)
class TerrainRows:
    """Trials of one terrain.

    Attributes:
        ground: what it is made of.
        trials: rows of every trial.
    """

    ground: Ground
    trials: tuple[SampleTable, ...]

    def thinned(self, count: int) -> "TerrainRows":
        """Return about so many rows, evenly from every trial."""
        share = max(count // max(len(self.trials), 1), 1)
        return TerrainRows(
            self.ground, tuple(_evenly(trial, share) for trial in self.trials)
        )


class Dissipation(NamedTuple):
    """How far a model keeps to F_t v_t >= 0 at forward slip: shares below 0 N.

    Attributes:
        latent: mean probability that the force without noise is below 0.
        predicted: the same of a measurement.
        measured: share of the measurements that are.
    """

    latent: float
    predicted: float
    measured: float


@dataclass(frozen=True, slots=True, eq=False)
class AllGroundModel:
    """The hierarchical model, given rows, predicting new trials of any ground.

    Attributes:
        process: its hyperparameters, of z.
        given: the process given rows.
        freedom: degrees of freedom of the spread between trials, on stones and plates.
        c: of the warp [N]; None for z = y.
        shapes: of the distribution on stones and plates, where they were worth one.
    """

    process: GroundProcess
    given: PredictiveProcess
    freedom: tuple[int, int]
    c: float | None
    shapes: tuple[ShapeMap | None, ShapeMap | None] = (None, None)

    @classmethod
    def of(
        cls, process: GroundProcess, c: float | None, known: Sequence[TerrainRows]
    ) -> "AllGroundModel":
        """Return the model with these hyperparameters, given trials.

        Raises:
            SettingsError: the covariance cannot be factorised.
        """
        rows = rows_of(known, c)
        return cls(process, process.given(rows), rows.freedom, c)

    def predict(self, ground: Ground, inputs: Array) -> NewTrialPrediction:
        """Return the distribution of measurements of a new trial.

        Args:
            ground: that it is recorded on, known or not.
            inputs: (F_n [N], v_t [m/s]), shape (m, 2).
        """
        return self._of_measurements(ground, self.given.predict(ground, inputs))

    def shaped(self, known: Sequence[TerrainRows]) -> "AllGroundModel":
        """Return the model with the shapes that trials of stones and plates ask for.

        Scored are rows that the process was given: 300 of a terrain, of which its
        function takes up about thirty. A shape has to raise the density of trials
        that it was not fitted to.
        """
        scores: tuple[list[Array], list[Array]] = ([], [])
        for rows in known:
            every = SampleTable.joined(rows.trials)
            found = self.predict(rows.ground, every.inputs).normal_score(every.F_t)
            ends = np.cumsum([table.count for table in rows.trials])[:-1]
            scores[rows.ground.is_plate].extend(np.split(found, ends))
        (stones, _), (plates, _) = (choose_shape(parts) for parts in scores)
        return replace(self, shapes=(stones, plates))

    def dissipation(self, ground: Ground, rows: SampleTable) -> Dissipation:
        """Return how far forces at these rows keep to F_t v_t >= 0."""
        from scipy.special import ndtr

        zero = warped(np.zeros(1), self.c)[0]
        z = self.given.predict(ground, rows.inputs)
        latent = ndtr((zero - z.mean) / np.sqrt(np.maximum(z.latent, 1e-12)))
        prediction = self._of_measurements(ground, z)
        return Dissipation(
            float(latent.mean()),
            float(prediction.cdf(np.zeros(rows.count)).mean()),
            float(np.mean(rows.F_t < 0.0)),
        )

    def _of_measurements(
        self, ground: Ground, z: GroundPrediction
    ) -> NewTrialPrediction:
        return NewTrialPrediction(
            centre=z.mean,
            within=z.latent + z.noise,
            between=np.full(z.mean.shape, z.between),
            freedom=max(self.freedom[ground.is_plate], FEWEST),
            c=self.c,
            shape=self.shapes[ground.is_plate],
        )


def rows_of(known: Sequence[TerrainRows], c: float | None) -> GroundRows:
    """Return the rows of trials with warped forces, as the process takes them."""
    tables = [table for terrain in known for table in terrain.trials]
    sizes = [table.count for table in tables]
    ground_index = [g for g, terrain in enumerate(known) for _ in terrain.trials]
    rows = SampleTable.joined(tables)
    return GroundRows(
        inputs=rows.inputs,
        y=warped(rows.F_t, c),
        ground=np.repeat(np.array(ground_index, dtype=np.intp), sizes),
        trial=np.repeat(np.arange(len(tables)), sizes),
        grounds=tuple(terrain.ground for terrain in known),
    )


def fit_all_ground(
    known: Sequence[TerrainRows], start: AllGroundModel | None = None
) -> AllGroundModel:
    """Return the model of all ground given trials.

    Args:
        known: trials of several terrains.
        start: a model of nearly the same trials, whose warp is kept.

    Raises:
        SettingsError: there are no rows, or their covariance cannot be factorised.
    """
    few = [rows.thinned(_TUNED) for rows in known]
    F_t = SampleTable.joined([table for rows in few for table in rows.trials]).F_t
    bends = bends_for(F_t, _BENDS)
    unit = {c: _unit(F_t, c) for c in _BENDS}
    if start is None:
        c = bends[0]
        process = GroundPosterior(rows_of(few, c), unit[c]).climbed()
        rated = {bend: _rated(few, F_t, process, unit, bend, c) for bend in bends}
        likeliest = max(bends, key=rated.__getitem__)
        if likeliest != c:
            theta = in_unit(process.theta, unit[likeliest] / unit[c])
            begin = replace(process, theta=theta).describe()
            c = likeliest
            process = GroundPosterior(rows_of(few, c), unit[c]).climbed(begin)
    else:
        c = start.c
        posterior = GroundPosterior(rows_of(few, c), unit[c])
        process = posterior.climbed(start.process.describe())
    given = [rows.thinned(GIVEN) for rows in known]
    return AllGroundModel.of(process, c, given).shaped(given)


def _rated(
    few: Sequence[TerrainRows],
    F_t: Array,
    process: GroundProcess,
    unit: Mapping[float | None, float],
    c: float | None,
    fitted: float | None,
) -> float:
    """Return the log posterior density of y under a warp, theta only rescaled.

    Args:
        few: rows of the trials.
        F_t: their forces [N].
        process: fitted under the warp `fitted`.
        unit: dz / dy of every warp.
        c: of the warp.
        fitted: see `process`.
    """
    theta = in_unit(process.theta, unit[c] / unit[fitted])
    value = GroundPosterior(rows_of(few, c), unit[c])(theta)[0]
    return value + float(log_warp_slope(F_t, c).sum())


def _unit(F_t: Array, c: float | None) -> float:
    """Return dz / dy at the median force."""
    return 1.0 if c is None else float(c / (np.median(F_t) + c))


def _evenly(table: SampleTable, count: int) -> SampleTable:
    """Return about `count` rows of a trial, evenly spaced over it."""
    positions = np.linspace(0, table.count - 1, min(count, table.count))
    return table.take(positions.round().astype(np.intp))
