"""Quality gate: review of a trial before the terrain is reset.

Also names the cell of speed and load with the fewest samples of the kept trials.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.sample import Flag
from analysis.data.events import find_slips
from analysis.data.lag import ForceLag
from analysis.data.load import load_trial
from analysis.data.plausibility import (
    FRICTION,
    Doubt,
    DoubtName,
    doubts_of,
    doubts_of_record,
)
from analysis.data.prepare import (
    MINIMUM_KEPT,
    PreparedTrial,
    PrepareOptions,
    prepare_trial,
)
from analysis.data.quality import (
    JOINT7_WARNING,
    CoverageGrid,
    coverage,
    quick_ratio,
    thinnest,
)
from experiments.operator.console import BAD, GOOD, WARNING
from experiments.operator.graphs import TravelTrace, trace_lines
from experiments.run.kept_trials import trace_to_json, traces_of
from experiments.session.derivation import kept_sidecars
from experiments.session.store import SessionFolder

STALE_SHARE = 0.01  # of the cycles
MIN_EARLIER = 3  # trials needed to call another one an outlier
OUTLIER_DEVIATIONS = 3.0  # standard deviations
MIN_SPREAD = 0.05  # of the mean; few trials may agree by chance
CELLS = (4, 4)  # speed and load cells of a coverage
MAX_SAMPLES = 1_000_000_000  # samples, limit of a plausible count


@dataclass(frozen=True, slots=True)
class Review:
    """Figures of one trial for the review page.

    Attributes:
        worst_gap: longest time between two cycles [s].
        missed: number of missing cycles.
        joint7: largest motion of joint 7 [rad].
        saturated: share of the cycles in which the force sensor was saturated.
        stale: share of the cycles without a fresh force sample.
        kept: samples inside the analysis window.
        fast: share of them above 0.2 m/s.
        slips: number of slips.
        ratio: slope of F_t over F_n of the kept samples; NaN without load.
        counts: samples per speed and load, shape (4, 4), see analysis.data.quality.
        doubts: reasons why velocity or forces are implausible.
        lag: lag of the forces; None if the trial does not determine it.
        v_t: median velocity of the kept samples [m/s]; NaN without any.
        traces: F_t and v_t over the travel along the container.
    """

    worst_gap: float
    missed: int
    joint7: float
    saturated: float
    stale: float
    kept: int
    fast: float
    slips: int
    ratio: float
    counts: NDArray[np.int64]
    doubts: tuple[Doubt, ...] = ()
    lag: ForceLag | None = None
    v_t: float = np.nan
    traces: tuple[TravelTrace, ...] = ()

    @property
    def ratio_or_none(self) -> float | None:
        """The slope, None if it is NaN."""
        return self.ratio if np.isfinite(self.ratio) else None

    def plain(self) -> dict[str, object]:
        """Return the figures for the journal, used by the table and later reviews."""
        return {
            "ratio": self.ratio_or_none,
            "coverage": self.counts.tolist(),
            "slips": self.slips,
            "v_t": None if np.isnan(self.v_t) else round(self.v_t, 4),
            "traces": {trace.name: trace_to_json(trace) for trace in self.traces},
        }

    def trace_lines(
        self, kept: Sequence[Mapping[str, NDArray[np.float64]]], name: str, width: int
    ) -> list[str]:
        """Return the traces in `width` columns, with the median of the kept trials.

        Args:
            kept: values of the kept trials by quantity.
            name: name of this trial.
            width: width of the terminal [characters].
        """
        lines: list[str] = []
        for trace in self.traces:
            others = [values[trace.name] for values in kept if trace.name in values]
            lines += trace_lines(trace, others, name, width)
        return lines

    def lines(self, earlier: Sequence[float] = ()) -> list[tuple[str, str]]:
        """Return (mark, text) of every line.

        Args:
            earlier: `ratio` of the trials kept so far, for comparison.
        """
        timing = GOOD if self.worst_gap < 0.004 and not self.missed else WARNING
        joint7 = GOOD if self.joint7 < JOINT7_WARNING else WARNING
        kept = GOOD if self.kept >= MINIMUM_KEPT else WARNING
        is_poor = self.saturated or self.stale > STALE_SHARE or self._doubt("frozen")
        sensor = WARNING if is_poor else GOOD
        fit, words = self._quick_fit(earlier)
        return [
            (
                timing,
                f"timing worst gap {self.worst_gap * 1e3:.1f} ms, missed {self.missed}",
            ),
            (sensor, self._sensor_words()),
            (joint7, f"joint 7 moved {self.joint7 * 1e3:.0f} mrad"),
            (
                kept,
                f"coverage {self.kept} samples, {self.fast:.0%} above 0.2 m/s · "
                f"slips {self.slips}",
            ),
            (fit, words),
            self._lag_line(),
            *((BAD, doubt.text) for doubt in self.doubts),
        ]

    def _doubt(self, name: DoubtName) -> Doubt | None:
        return next((doubt for doubt in self.doubts if doubt.name == name), None)

    def _lag_line(self) -> tuple[str, str]:
        """Return (mark, text) on the lag of the forces."""
        if self.lag is None:
            return WARNING, "lag of the force unknown: the motion does not show it"
        late = self.lag.seconds * 1e3
        words = f"lag force {abs(late):.1f} ms {'late' if late >= 0 else 'early'}"
        return WARNING if self._doubt("lag") else GOOD, words

    def _sensor_words(self) -> str:
        if frozen := self._doubt("frozen"):
            return f"sensor unreliable: {frozen.seen}"
        if self.saturated:
            return f"sensor saturated in {self.saturated:.1%} of the cycles"
        if self.stale > STALE_SHARE:
            return f"sensor stale in {self.stale:.1%} of the cycles"
        return "sensor no saturation"

    def _quick_fit(self, earlier: Sequence[float]) -> tuple[str, str]:
        """Return (mark, text) on the slope, compared with the earlier ones."""
        if np.isnan(self.ratio):
            return WARNING, "quick fit impossible: no load"
        words = f"quick fit F_t/F_n {self.ratio:.2f}"
        if not _is_friction(self.ratio):
            return BAD, f"{words} cannot be: above 0 and at most {FRICTION[1]:g} can"
        if self.doubts:
            return WARNING, f"{words}, unreliable"
        valid = [ratio for ratio in earlier if _is_friction(ratio)]
        if len(valid) < MIN_EARLIER:
            return GOOD, words
        mean, spread = float(np.mean(valid)), float(np.std(valid, ddof=1))
        is_outlier = abs(self.ratio - mean) > OUTLIER_DEVIATIONS * max(
            spread, MIN_SPREAD * mean
        )
        words += f" ({len(valid)} before: {mean:.2f} ± {spread:.2f})"
        return WARNING if is_outlier else GOOD, words


def review_trial(path: Path) -> Review:
    """Review a trial from its finished file.

    Raises:
        TrialFileError: `path` cannot be read.
    """
    trial = load_trial(path)
    prepared = prepare_trial(
        trial.series(), PrepareOptions(container_travel=trial.frame.travel)
    )
    q7 = trial.cycles["position"][:, 6]
    flags = trial.cycles["flags"]
    steps = np.diff(trial.cycles["cycle"].astype(int))
    covered = coverage([prepared])
    return Review(
        worst_gap=float(np.diff(trial.t).max()),
        missed=int((steps - 1).sum()),
        joint7=float(np.abs(q7 - q7[0]).max()),
        saturated=float(((flags & Flag.FT_SATURATED) != 0).mean()),
        stale=float(((flags & Flag.FT_FRESH) == 0).mean()),
        kept=int(prepared.kept),
        fast=covered.fast_share,
        slips=len(find_slips(prepared.smooth)),
        ratio=quick_ratio(prepared),
        counts=covered.counts,
        doubts=(*doubts_of(prepared), *doubts_of_record(trial)),
        lag=prepared.lag,
        v_t=_median_speed(prepared),
        traces=traces_of(trial),
    )


def _is_friction(ratio: float) -> bool:
    """Return whether F_t/F_n is possible: the ground never drives the foot."""
    return 0.0 < ratio <= FRICTION[1]


def _median_speed(prepared: PreparedTrial) -> float:
    speeds = prepared.v_t
    return float(np.median(speeds)) if len(speeds) else np.nan


def thinnest_cell(folder: SessionFolder) -> str:
    """Name the cell of speed and load with the fewest samples of a session."""
    counts = np.zeros(CELLS, np.int64)
    for sidecar in kept_sidecars(folder):
        counts += cells_of(sidecar.get("coverage"))
    return thinnest(CoverageGrid(counts))


def cells_of(value: object) -> NDArray[np.int64]:
    """Parse a coverage of a sidecar, shape (4, 4); zeros if it is malformed."""
    try:
        counts = np.array(value, np.int64)
    except (ValueError, TypeError, OverflowError):
        counts = np.zeros(0, np.int64)
    is_map = counts.shape == CELLS and bool(
        (counts >= 0).all() & (counts < MAX_SAMPLES).all()
    )
    return counts if is_map else np.zeros(CELLS, np.int64)
