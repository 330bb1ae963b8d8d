"""Clocks of a log: stamps of the senders, and the recorder's receipts beside them.

Stamps are the clock. Receipt less stamp is a delay and what the two clocks differ by:

    receipt - stamp = offset + drift (receipt - first receipt) + delay,   delay >= 0

so the line lies below the messages that arrived fastest. What it shows beyond 20 ms or
50 ppm has to be decided by a person, because a log does not say which clock is right.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from analysis.data.series import Array

Nanoseconds = NDArray[np.int64]
LARGEST_OFFSET = 0.020  # s between the clocks of two topics, and of a step
LARGEST_DRIFT = 50e-6  # s/s
_LEAST_DRIFTED = 0.002  # s over the log: less is no more than delays vary
_MOST_BINS, _FEWEST_IN_BIN = 50, 20
_LASTING = 3  # bins on both sides of a step: one late bin is a stall of the network
_SLOWEST = 0.01  # of the recorder's clock; stamps that run slower are none
_NS = 1e-9
_WAY_OUT = (
    "--clock stamp takes the stamps as they are, --clock receipt the recorder's times."
)


@dataclass(frozen=True, slots=True)
class ClockLine:
    """The line through receipt less stamp of the messages that arrived fastest.

    Attributes:
        offset: at the first message [s].
        drift: of the stamps against the recorder's clock [s/s]; > 0 = they run fast.
        sure: 95 % interval of the drift [s/s].
        span: of the messages by receipt [s].
        step: largest jump of the stamps against the line [s].
        step_at: when, since the first receipt [s].
    """

    offset: float
    drift: float
    sure: tuple[float, float]
    span: float
    step: float
    step_at: float

    @property
    def is_drifting(self) -> bool:
        """The drift is beyond its limit, and not by chance."""
        low, high = self.sure
        is_beyond = low > LARGEST_DRIFT or high < -LARGEST_DRIFT
        return is_beyond and abs(self.drift) * self.span > _LEAST_DRIFTED

    @property
    def has_step(self) -> bool:
        """The stamps jump against the recorder's clock by more than the limit."""
        return abs(self.step) > LARGEST_OFFSET

    @property
    def text(self) -> str:
        """Offset, drift and the largest step, for people."""
        return (
            f"receipt less stamp {self.offset * 1e3:.1f} ms, {_rate_text(self.drift)}, "
            f"largest step {self.step * 1e3:.1f} ms"
        )

    def recorder_times(self, stamps: Nanoseconds, received: Nanoseconds) -> Nanoseconds:
        """Stamps moved onto the recorder's clock by the line [ns], shape (n,)."""
        first = int(received.min())
        late = (stamps - first).astype(np.float64) * _NS + self.offset
        return first + np.rint(late / (1.0 + self.drift) / _NS).astype(np.int64)


def fit_clock(stamps: Nanoseconds, received: Nanoseconds) -> ClockLine | None:
    """Fit receipt less stamp; None for fewer than 60 messages or a span of nothing.

    Args:
        stamps: [ns], shape (n,).
        received: [ns], shape (n,).
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
    # a step tilts the line, but not the middle one of the slopes from bin to bin
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


def _largest_step(rest: Array) -> tuple[float, int]:
    """Largest jump of a level that lasts, and the row at which it begins."""
    width = min(_LASTING, len(rest) // 2)
    jumps = [
        float(np.median(rest[k : k + width]) - np.median(rest[k - width : k]))
        for k in range(width, len(rest) - width + 1)
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
    """Sentences on a step and a drift of one topic that are beyond the limits."""
    found: list[str] = []
    if fit.has_step:
        found.append(
            f"the stamps of {topic} jump by {fit.step * 1e3:.0f} ms against the "
            f"recorder's clock, {fit.step_at:.1f} s after its first message (limit "
            f"{LARGEST_OFFSET * 1e3:.0f} ms)"
        )
    if fit.is_drifting:
        found.append(
            f"the clock of {topic} is not the recorder's: {_rate_text(fit.drift)}, "
            f"{abs(fit.drift) * fit.span * 1e3:.0f} ms over the log (limit "
            f"{LARGEST_DRIFT * 1e6:.0f} ppm)"
        )
    return found


def lag_by_receipts(joints: ClockLine | None, wrench: ClockLine | None) -> float | None:
    """How late the wrench is stamped by both offsets [s]; None where one is unknown.

    The delays of both topics are a part of it.
    """
    if joints is None or wrench is None:
        return None
    return joints.offset - wrench.offset


def doubts_of_lag(shown: float | None, lag: float) -> list[str]:
    """Sentence on clocks that are apart by more than the lag that is stated [s].

    A lag that receipts do not show is no doubt: a filter may be late before the stamp.
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
    """Refuse clocks that a person has to decide on.

    Raises:
        SettingsError: there is a doubt.
    """
    if doubts:
        lag = "" if shown is None else f" Or state --lag {shown * 1e3:.0f}."
        raise SettingsError(f"{log}: {'; '.join(doubts)}.", hint=f"{_WAY_OUT}{lag}")
