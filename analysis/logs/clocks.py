"""Clocks of a log: stamps of the senders compared with receipt times of the recorder.

The stamps are used by default. Receipt minus stamp is delay plus clock difference:

    receipt - stamp = offset + drift (receipt - first receipt) + delay,   delay >= 0

so the line is the lower envelope, through the fastest messages. The user must decide on
differences beyond 20 ms or 50 ppm, because a log does not say which clock is right.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from analysis.data.series import Array

Nanoseconds = NDArray[np.int64]
LARGEST_OFFSET = 0.020  # s, limit between the clocks of two topics, and of a step
LARGEST_DRIFT = 50e-6  # s/s
_LEAST_DRIFTED = 0.002  # s over the log; smaller drifts are within the delay variation
_MOST_BINS, _FEWEST_IN_BIN = 50, 20
_LASTING = 3  # bins on both sides of a step; a single late bin is a network stall
_SLOWEST = 0.01  # rate relative to the recorder's clock below which stamps are invalid
_NS = 1e-9
_WAY_OUT = (
    "--clock stamp takes the stamps as they are, --clock receipt the recorder's times."
)


@dataclass(frozen=True, slots=True)
class ClockLine:
    """Line fit of receipt minus stamp through the fastest messages.

    Attributes:
        offset: offset at the first message [s].
        drift: drift of the stamps relative to the recorder's clock [s/s]; > 0 = fast.
        sure: 95 % interval of the drift [s/s].
        span: duration of the messages by receipt [s].
        step: largest lasting step of the stamps relative to the line [s].
        step_at: time of the step since the first receipt [s].
    """

    offset: float
    drift: float
    sure: tuple[float, float]
    span: float
    step: float
    step_at: float

    @property
    def is_drifting(self) -> bool:
        """Whether the drift is significantly beyond its limit."""
        low, high = self.sure
        is_beyond = low > LARGEST_DRIFT or high < -LARGEST_DRIFT
        return is_beyond and abs(self.drift) * self.span > _LEAST_DRIFTED

    @property
    def has_step(self) -> bool:
        """Whether the stamps jump relative to the recorder's clock beyond the limit."""
        return abs(self.step) > LARGEST_OFFSET

    @property
    def text(self) -> str:
        """Offset, drift and largest step in words."""
        return (
            f"receipt less stamp {self.offset * 1e3:.1f} ms, {_rate_text(self.drift)}, "
            f"largest step {self.step * 1e3:.1f} ms"
        )

    def recorder_times(self, stamps: Nanoseconds, received: Nanoseconds) -> Nanoseconds:
        """Convert stamps to the recorder's clock by the line [ns], shape (n,)."""
        first = int(received.min())
        late = (stamps - first).astype(np.float64) * _NS + self.offset
        return first + np.rint(late / (1.0 + self.drift) / _NS).astype(np.int64)


def fit_clock(stamps: Nanoseconds, received: Nanoseconds) -> ClockLine | None:
    """Fit receipt minus stamp; None with fewer than 60 messages or no duration.

    Args:
        stamps: stamps [ns], shape (n,).
        received: receipt times [ns], shape (n,).
    """
    from scipy.stats import theilslopes

    t = (received - received.min()).astype(np.float64) * _NS
    count = min(_MOST_BINS, len(t) // _FEWEST_IN_BIN)
    span = float(t.max()) if len(t) else 0.0
    if count < 3 or span <= 0.0:
        return None
    late = (received - stamps).astype(np.float64) * _NS
    number = np.minimum((t / span * count).astype(int), count - 1)
    fastest = [_fastest(np.flatnonzero(number == k), late) for k in range(count)]
    rows = np.array([row for row in fastest if row is not None])
    if len(rows) < 3:
        return None
    slope, offset, low, high = np.asarray(theilslopes(late[rows], t[rows])).tolist()
    if 1.0 - slope < _SLOWEST:
        return None
    # a step tilts the line, but not the median of the slopes from bin to bin
    pace = float(np.median(np.diff(late[rows]) / np.diff(t[rows])))
    step, row = _largest_step(late[rows] - pace * t[rows])
    return ClockLine(
        offset=offset,
        drift=-slope,
        sure=(-high, -low),
        span=span,
        step=-step,
        step_at=float(t[rows[row]]),
    )


def _largest_step(residual: Array) -> tuple[float, int]:
    """Return the largest lasting step in level and the row at which it begins."""
    width = min(_LASTING, len(residual) // 2)
    jumps = [
        float(np.median(residual[k : k + width]) - np.median(residual[k - width : k]))
        for k in range(width, len(residual) - width + 1)
    ]
    worst = int(np.abs(jumps).argmax())
    return jumps[worst], worst + width


def _fastest(rows: NDArray[np.intp], late: Array) -> int | None:
    return int(rows[late[rows].argmin()]) if len(rows) else None


def _rate_text(drift: float) -> str:
    if abs(drift) > 0.01:
        return f"the stamps run at {1.0 + drift:.3g} times the recorder's clock"
    return f"drift {drift * 1e6:+.0f} ppm"


def doubts_of_clock(topic: str, fit: ClockLine) -> list[str]:
    """Return warnings for a step or drift of one topic beyond the limits."""
    doubts: list[str] = []
    if fit.has_step:
        doubts.append(
            f"the stamps of {topic} jump by {fit.step * 1e3:.0f} ms against the "
            f"recorder's clock, {fit.step_at:.1f} s after its first message (limit "
            f"{LARGEST_OFFSET * 1e3:.0f} ms)"
        )
    if fit.is_drifting:
        doubts.append(
            f"the clock of {topic} is not the recorder's: {_rate_text(fit.drift)}, "
            f"{abs(fit.drift) * fit.span * 1e3:.0f} ms over the log (limit "
            f"{LARGEST_DRIFT * 1e6:.0f} ppm)"
        )
    return doubts


def lag_by_receipts(joints: ClockLine | None, wrench: ClockLine | None) -> float | None:
    """Return the lag of the wrench stamps by both offsets [s]; None if one is unknown.

    The lag includes the delays of both topics.
    """
    if joints is None or wrench is None:
        return None
    return joints.offset - wrench.offset


def doubts_of_lag(shown: float | None, lag: float) -> list[str]:
    """Return a warning if the clocks differ by more than the stated lag [s].

    A stated lag that the receipts do not show is accepted: a filter may delay the
    readings before they are stamped.
    """
    if shown is None or min(abs(shown), abs(shown - lag)) <= LARGEST_OFFSET:
        return []
    apart = f"{shown:.1f} s" if abs(shown) >= 1.0 else f"{shown * 1e3:.0f} ms"
    return [
        f"two clocks: by the receipts the wrench is stamped {apart} later than the "
        f"joints, --lag says {lag * 1e3:g} ms (limit {LARGEST_OFFSET * 1e3:.0f} ms "
        "apart)"
    ]


def require_no_doubt(doubts: list[str], log: object, shown: float | None) -> None:
    """Refuse clocks on which the user has to decide.

    Raises:
        SettingsError: there is at least one doubt.
    """
    if doubts:
        lag = "" if shown is None else f" Or state --lag {shown * 1e3:.0f}."
        raise SettingsError(f"{log}: {'; '.join(doubts)}.", hint=f"{_WAY_OUT}{lag}")
