"""A recorded trial as foresight saw it while it happened, and what came of it.

Ticks are labelled by the slips of the record: `find_slips`, centred, so that the truth
may look ahead while no feature does. At risk is a tick in contact and in no slip; it is
positive if a slip begins within the next 0.2 s.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from acquisition.clock import PERIOD_NS
from analysis.data.events import find_slips
from analysis.data.load import RecordedTrial, load_trial
from analysis.data.prepare import PrepareOptions, Smoothed, smoothed
from analysis.data.series import Array, Indices, TractionSeries
from analysis.data.terrain_kinds import groups_of
from analysis.foresight.foot_record import FootRecord, ticks_of_record
from analysis.foresight.ground_window import FASTEST, SLOWEST, windows_of
from analysis.foresight.model import RigIdentity
from analysis.foresight.signals import PERIOD, FootSample

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
        record: every cycle.
        onsets: when slips began [s since the first cycle].
        ends: when they ended [s], of the same shape.
        tick: number of every tick, shape (n,).
        t: its time [s], shape (n,).
        features: of `signals`, shape (n, 23).
        motion: v_t [m/s], F_t [N], F_n [N] of every tick, shape (n, 3).
        windows: features of overlapping windows of sliding, by their size [ticks].
    """

    terrain: str
    name: str
    surface: str
    rig: RigIdentity
    seed: str
    record: FootRecord
    onsets: Array
    ends: Array
    tick: Indices
    t: Array
    features: Array
    motion: Array
    windows: Mapping[int, Array]

    @property
    def samples(self) -> tuple[FootSample, ...]:
        """Every cycle."""
        return tuple(self.record.samples)

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
        return _sliding(self.motion)


def _sliding(motion: Array) -> list[int]:
    """Return the rows in which the foot slides, of v_t, F_t and F_n."""
    v, F_n = motion[:, 0], motion[:, 2]
    is_sliding = (v >= SLOWEST) & (v <= FASTEST) & (F_n > _CONTACT)
    return np.flatnonzero(is_sliding).tolist()


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
    smooth = smoothed(trial.series(), PrepareOptions())
    along = trial.frame.axes()[0].tolist()  # live values, not those computed anew
    return _watched(origin, FootRecord.of(trial.cycles, along), smooth)


@dataclass(frozen=True, slots=True)
class WatchTask:
    """A trial on disk.

    Attributes:
        path: the file.
        surface: "flat", "rocky" or a word of its own.
    """

    path: Path
    surface: str


def watch_file(task: WatchTask) -> WatchedTrial:
    """Return a trial on disk with its features and its slips.

    Raises:
        TrialFileError: the file is not a sound trial.
    """
    return watch(load_trial(task.path), task.surface)


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
    smooth = smoothed(series, PrepareOptions())
    start = float(series.t[0])
    numbers = np.arange(round((float(series.t[-1]) - start) / PERIOD) + 1)
    grid = start + numbers * PERIOD
    steps = 0.5 * (series.v_t[1:] + series.v_t[:-1]) * np.diff(series.t)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    columns = (way, series.F_t, series.F_n)
    x, F_t, F_n = (np.interp(grid, series.t, column) for column in columns)
    record = FootRecord(numbers, numbers * PERIOD_NS, x, F_t, F_n)
    origin = _Origin(series.terrain, series.name, surface, rig, "")
    moved = replace(smooth, t=smooth.t - start)
    return _watched(origin, record, moved)


class _Origin(NamedTuple):
    """Where a trial comes from."""

    terrain: str
    name: str
    surface: str
    rig: RigIdentity
    seed: str


def _watched(origin: _Origin, record: FootRecord, smooth: Smoothed) -> WatchedTrial:
    """Return a record with features and slips; both times begin with the first."""
    slips, ticks = find_slips(smooth), ticks_of_record(record)
    rows = _sliding(ticks.motion)
    return WatchedTrial(
        **origin._asdict(),
        record=record,
        onsets=np.array([slip.onset for slip in slips]),
        ends=np.array([slip.end for slip in slips]),
        tick=ticks.tick,
        t=_seconds(ticks.host_ns, record.host_ns[:1]),
        features=ticks.features,
        motion=ticks.motion,
        windows=windows_of(ticks.tick[rows], ticks.motion[rows]),
    )


def _seconds(host_ns: Indices, first: Indices) -> Array:
    """Return times since the first cycle [s], rounded as plain floats are."""
    return (host_ns - first.astype(np.float64)) * 1e-9


def watch_all(
    trials: Mapping[str, Iterable[RecordedTrial]], kinds: Mapping[str, str]
) -> list[WatchedTrial]:
    """Return all trials of a study, watched.

    Args:
        trials: recorded trials by terrain.
        kinds: kind by terrain, as of `terrain_kind`.
    """
    surface = groups_of(kinds)["surface"]
    return [watch(t, surface[name]) for name, own in trials.items() for t in own]
