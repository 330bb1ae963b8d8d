"""Measures of groups D, E and F: slips, samples and the sensor at rest."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.events import Slip
from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array, TractionSeries

LOW_FLOOR = 0.3  # share of the peak
_REST_MARGIN = 0.1  # s before the first motion, not counted as rest
_SHORTEST_REST = 0.2  # s
_START = 0.4  # s at the start of a trial without motion of the foot
_MOVING = 0.005  # m/s


@dataclass(frozen=True, slots=True)
class GroundTrials:
    """The trials of one terrain.

    Attributes:
        is_plate: whether it is a flat plate without stones.
        series: recorded series.
        prepared: series smoothed, thinned, windowed.
        slips: slips of every trial.
    """

    is_plate: bool
    series: tuple[TractionSeries, ...]
    prepared: tuple[PreparedTrial, ...]
    slips: tuple[tuple[Slip, ...], ...]

    @property
    def slips_per_trial(self) -> float:
        """Mean number of slips."""
        return float(np.mean([len(of_trial) for of_trial in self.slips]))

    def kept(self, column: str) -> Array:
        """Return a column of the kept samples of all trials."""
        return np.concatenate([getattr(trial, column) for trial in self.prepared])

    def share(self, name: str) -> float:
        """Mean share of the thinned samples over the trials."""
        return float(np.mean([getattr(t.shares, name) for t in self.prepared]))


def measure_slips(grounds: Mapping[str, GroundTrials]) -> dict[str, list[float]]:
    """Return the values of D1 to F2 except E7, by id."""
    stones = [g for g in grounds.values() if not g.is_plate]
    plates = [g for g in grounds.values() if g.is_plate]
    pooled = [slip for g in stones for of_trial in g.slips for slip in of_trial]
    return {
        "D1": [g.slips_per_trial for g in stones],
        "D2": [g.slips_per_trial for g in plates],
        **_of_slips(pooled),
        **_of_samples(list(grounds.values()), stones, plates),
        **_of_rest(list(grounds.values()), plates),
    }


def _of_slips(slips: Sequence[Slip]) -> dict[str, list[float]]:
    if not slips:
        return {}
    floors = np.array([slip.floor / slip.peak for slip in slips])
    spikes = [slip.spike / slip.peak for slip in slips if slip.spike is not None]
    peaks = np.array([slip.peak for slip in slips])
    lengths = np.array([slip.length for slip in slips])
    return {
        "D3": [float(np.median(floors))],
        "D4": [float(np.mean(floors < LOW_FLOOR))],
        "D5": [float(np.mean([slip.has_bounce for slip in slips]))],
        "D6": [float(np.median(spikes))] if spikes else [],
        "D7": [float(np.mean([slip.has_sag for slip in slips]))],
        "D8": [float(peaks.std() / peaks.mean())],
        "D9": [float(lengths.std() / lengths.mean())],
        "D10": [float(np.median([slip.peak_speed for slip in slips]))],
    }


def _of_samples(
    every: Sequence[GroundTrials],
    stones: Sequence[GroundTrials],
    plates: Sequence[GroundTrials],
) -> dict[str, list[float]]:
    inside = [
        [trial.shares.window_of_moving for trial in ground.prepared] for ground in every
    ]
    return {
        "E1": [float(np.mean([s for s in row if s is not None])) for row in inside],
        "E2": [g.share("sticking") for g in stones],
        "E3": [g.share("backward") for g in stones],
        "E4": [g.share("backward") for g in plates],
        "E5": [_correlation(g, "v_t") for g in stones],
        "E6": [float(np.mean([_correlation(g, "F_n") for g in stones]))],
        "E8": [float(g.kept("F_n").mean()) for g in every],
        "E9": [float(np.percentile(g.kept("F_t"), 99)) for g in stones],
        "E10": [float(np.mean([s.t[-1] - s.t[0] for s in g.series])) for g in every],
        "E11": [float(min(trial.kept for g in every for trial in g.prepared))],
    }


def _of_rest(
    every: Sequence[GroundTrials], plates: Sequence[GroundTrials]
) -> dict[str, list[float]]:
    rests = [rest for g in every for rest in _rests(g)]
    starts = [
        float(s.F_t[s.t - s.t[0] < _START].mean()) for g in plates for s in g.series
    ]
    # Differences of neighbouring samples are free of drift and load.
    white = [float(np.diff(rest).std() / np.sqrt(2.0)) for rest in rests]
    return {
        "F1": [float(np.median(white))] if white else [],
        "F2": [float(np.std(starts, ddof=1))] if len(starts) > 1 else [],
    }


def _rests(ground: GroundTrials) -> list[Array]:
    """Raw F_t of every trial before its foot moves [N]."""
    rests: list[Array] = []
    for series, prepared in zip(ground.series, ground.prepared, strict=True):
        moving = np.flatnonzero(np.abs(prepared.smooth.v_t) > _MOVING)
        begin = prepared.smooth.t[moving[0]] if moving.size else series.t[-1]
        rest = series.F_t[series.t < begin - _REST_MARGIN]
        if rest.size >= _SHORTEST_REST * series.rate:
            rests.append(rest)
    return rests


def _correlation(ground: GroundTrials, column: str) -> float:
    return float(np.corrcoef(ground.kept("F_t"), ground.kept(column))[0, 1])
