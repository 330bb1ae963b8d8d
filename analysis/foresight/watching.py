"""A recorded trial as foresight saw it while it happened, and what came of it.

Ticks are labelled by the slips of the record: `find_slips`, centred, so that the truth
may look ahead while no feature does. At risk is a tick in contact and in no slip; it is
positive if a slip begins within the next 0.2 s.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import NamedTuple

import numpy as np

from acquisition import PERIOD_NS
from analysis.data import (
    Array,
    Indices,
    PrepareOptions,
    RecordedTrial,
    Smoothed,
    TractionSeries,
    find_slips,
    groups_of,
    prepare_trial,
)
from analysis.foresight.engine import EVERY, FootSample
from analysis.foresight.ground_window import FASTEST, SLOWEST
from analysis.foresight.model import RigIdentity
from analysis.foresight.signals import FEATURES, PERIOD, Signals

HORIZON = 0.2  # s
FLAT_SURFACE, ROCKY_SURFACE = "flat", "rocky"
_CONTACT = 0.5  # N
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class WatchedTrial:
    """A trial as foresight saw it while it happened, and what came of it.

    Attributes:
        terrain: its name.
        name: of the trial.
        surface: "flat", "rocky" or a word of its own.
        rig: foot and rig.
        seed: of the simulation, "" where there was none.
        samples: every cycle.
        onsets: when slips began [s since the first cycle].
        ends: when they ended [s], of the same shape.
        tick: number of every tick, shape (n,).
        t: its time [s], shape (n,).
        features: of `signals`, shape (n, 23).
        motion: v_t [m/s], F_t [N], F_n [N] of every tick, shape (n, 3).
    """

    terrain: str
    name: str
    surface: str
    rig: RigIdentity
    seed: str
    samples: tuple[FootSample, ...]
    onsets: Array
    ends: Array
    tick: Indices
    t: Array
    features: Array
    motion: Array

    @property
    def is_at_risk(self) -> np.ndarray:
        """Whether a tick is in contact and in no slip, shape (n,)."""
        is_in_slip = np.zeros(self.t.size, dtype=np.bool_)
        for onset, end in zip(self.onsets, self.ends, strict=True):
            is_in_slip |= (self.t >= onset) & (self.t <= end)
        return ~is_in_slip & (self.motion[:, 2] > _CONTACT)

    @property
    def is_before_slip(self) -> np.ndarray:
        """Whether a slip begins within 0.2 s, shape (n,)."""
        is_before = np.zeros(self.t.size, dtype=np.bool_)
        for onset in self.onsets:
            early = onset - HORIZON - _ROUNDING
            is_before |= (self.t >= early) & (self.t < onset)
        return is_before

    @property
    def sliding(self) -> list[int]:
        """Rows of the ticks in which the foot slides."""
        v, F_n = self.motion[:, 0], self.motion[:, 2]
        is_sliding = (v >= SLOWEST) & (v <= FASTEST) & (F_n > _CONTACT)
        return np.flatnonzero(is_sliding).tolist()


def foot_samples(trial: RecordedTrial) -> tuple[FootSample, ...]:
    """Return the cycles of a record as foresight read them while it was recorded.

    Live values are taken, not those that the analysis computes anew.
    """
    along = trial.frame.axes()[0].tolist()
    rows = zip(
        trial.cycles["cycle"].tolist(),
        trial.cycles["host_ns"].tolist(),
        trial.cycles["foot_position"].tolist(),
        trial.cycles["traction"].tolist(),
        strict=True,
    )
    return tuple(
        FootSample(cycle, host_ns, way_along(along, sole), forces[1], forces[2])
        for cycle, host_ns, sole, forces in rows
    )


def way_along(along: Sequence[float], position: Sequence[float]) -> float:
    """Return the way of a position along x_T [m], in a fixed order of additions."""
    way = along[0] * position[0] + along[1] * position[1]
    return way + along[2] * position[2]


def watch(trial: RecordedTrial, surface: str) -> WatchedTrial:
    """Return a recorded trial with its features and its slips."""
    metadata = trial.metadata["trial"]
    origin = _Origin(
        trial.terrain,
        trial.name,
        surface,
        RigIdentity.of(metadata),
        metadata.get("seed", ""),
    )
    smooth = prepare_trial(trial.series(), PrepareOptions()).smooth
    return _watched(origin, foot_samples(trial), smooth)


def watch_series(
    series: TractionSeries, surface: str, rig: RigIdentity
) -> WatchedTrial:
    """Return a trial of a table as it would have been foreseen, at 500 Hz.

    The way of the sole is that of its velocity; between rows values are linear.

    Args:
        series: the trial.
        surface: "flat", "rocky" or a word of its own.
        rig: foot and rig that it is taken to be from.
    """
    smooth = prepare_trial(series, PrepareOptions()).smooth
    start = float(series.t[0])
    numbers = np.arange(round((float(series.t[-1]) - start) / PERIOD) + 1)
    grid = start + numbers * PERIOD
    steps = 0.5 * (series.v_t[1:] + series.v_t[:-1]) * np.diff(series.t)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    columns = (way, series.F_t, series.F_n)
    rows = zip(
        numbers.tolist(),
        (numbers * PERIOD_NS).tolist(),
        *(np.interp(grid, series.t, column).tolist() for column in columns),
        strict=True,
    )
    origin = _Origin(series.terrain, series.name, surface, rig, "")
    moved = replace(smooth, t=smooth.t - start)
    return _watched(origin, tuple(FootSample(*row) for row in rows), moved)


class _Origin(NamedTuple):
    """Where a trial comes from."""

    terrain: str
    name: str
    surface: str
    rig: RigIdentity
    seed: str


def _watched(
    origin: _Origin, samples: tuple[FootSample, ...], smooth: Smoothed
) -> WatchedTrial:
    """Return samples with features and slips; both times begin with the first."""
    slips = find_slips(smooth)
    tick, t, features, motion = _ticks(samples, float(samples[0].host_ns))
    return WatchedTrial(
        **origin._asdict(),
        samples=samples,
        onsets=np.array([slip.onset for slip in slips]),
        ends=np.array([slip.end for slip in slips]),
        tick=tick,
        t=t,
        features=features,
        motion=motion,
    )


def watch_all(
    trials: Mapping[str, Iterable[RecordedTrial]], kinds: Mapping[str, str]
) -> list[WatchedTrial]:
    """Return all trials of a study, watched.

    Args:
        trials: recorded trials by terrain.
        kinds: kind by terrain, as of `terrain_kind`.
    """
    surface = groups_of(kinds)["surface"]
    return [watch(t, surface[name]) for name, of in trials.items() for t in of]


def _ticks(
    samples: Sequence[FootSample], start_ns: float
) -> tuple[Indices, Array, Array, Array]:
    """Return number, time, features and motion of every tick with warm filters."""
    ticks: list[int] = []
    times: list[float] = []
    features: list[list[float]] = []
    motion: list[tuple[float, float, float]] = []
    for sample, signals in _filtered(samples):
        if sample.cycle % EVERY == 0 and signals.is_warm:
            ticks.append(sample.cycle // EVERY)
            times.append((sample.host_ns - start_ns) * 1e-9)
            features.append(signals.features())
            motion.append((signals.v_t, signals.F_t, signals.F_n))
    shape = (len(times), len(FEATURES))
    return (
        np.array(ticks, dtype=np.intp),
        np.array(times),
        np.array(features).reshape(shape),
        np.array(motion).reshape(-1, 3),
    )


def _filtered(samples: Sequence[FootSample]) -> Iterator[tuple[FootSample, Signals]]:
    signals, last = None, -1
    for sample in samples:
        if not (isfinite(sample.x) and isfinite(sample.F_t) and isfinite(sample.F_n)):
            continue
        if signals is None or sample.cycle != last + 1:
            signals = Signals(sample.x, sample.F_t, sample.F_n)
        else:
            signals.push(sample.x, sample.F_t, sample.F_n)
        last = sample.cycle
        yield sample, signals
