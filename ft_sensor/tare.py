"""Tare: mean reading of the sensor without contact."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from acquisition.clock import NS_PER_S, RATE_HZ
from acquisition.devices import WrenchSample
from acquisition.errors import TractionError

Wrench = tuple[float, float, float, float, float, float]

MIN_DURATION = 1.0  # [s]
WINDOW = 0.2  # [s]
SLOWEST = float(RATE_HZ)  # lowest sample rate of a sensor [Hz]
_FEWEST = 0.5  # least share of a window's nominal samples
_AGAIN = "[space] to try again."


class TareError(TractionError):
    """Samples not suitable for a tare.

    Attributes:
        spread: variation of the force [N]; None for other reasons.
    """

    exit_code = 3

    def __init__(self, message: str, *, hint: str, spread: float | None = None) -> None:
        super().__init__(message, hint=hint)
        self.spread = spread


@dataclass(frozen=True, slots=True)
class TareResult:
    """Mean wrench at rest.

    Attributes:
        t_ns: monotonic time of the last sample [ns].
        wrench: mean fx fy fz tx ty tz in the sensor frame [N, N m].
        spread: largest range of the 0.2 s means over the three force components [N].
    """

    t_ns: int
    wrench: Wrench
    spread: float


def take_mean(
    samples: Sequence[WrenchSample],
    spread_limit: float,
    rate: float = SLOWEST,
) -> TareResult:
    """Return the mean of at least one second of raw samples, oldest first.

    White noise averages out in 0.2 s means; variation between them is contact or drift.
    Zeroing in the device is not used: it is lost at power-off. Each 0.2 s must hold at
    least half of the samples expected at `rate` [Hz].

    Raises:
        TareError: too few samples or a gap, a flagged or non-finite sample, or a
            spread above `spread_limit` [N].
    """
    _refuse_flagged(samples)
    windows = _windows(samples, _FEWEST * rate * WINDOW)
    wrenches = np.array([sample.wrench for sample in samples], dtype=np.float64)
    if not np.isfinite(wrenches).all():
        raise TareError(
            "The F/T sensor sent non-finite values in the tare.", hint=_AGAIN
        )
    spread = _force_spread(wrenches, windows)
    if spread > spread_limit:
        raise TareError(
            f"Force varied {spread:.1f} N during tare "
            f"({WINDOW:g} s means, limit {spread_limit:g}).",
            hint=f"Is the foot touching? {_AGAIN}",
            spread=spread,
        )
    return TareResult(
        t_ns=samples[-1].t_ns,
        wrench=cast("Wrench", tuple(wrenches.mean(axis=0).tolist())),
        spread=spread,
    )


def _refuse_flagged(samples: Sequence[WrenchSample]) -> None:
    flagged = [s for s in samples if s.status or s.saturated or not s.is_valid]
    if flagged:
        raise TareError(
            f"{len(flagged)} of {len(samples)} F/T samples were flagged during tare "
            f"(first status 0x{flagged[0].status:04x}).",
            hint=f"Is the sensor overloaded or its cable loose? {_AGAIN}",
        )


def _windows(samples: Sequence[WrenchSample], minimum: float) -> NDArray[np.int64]:
    """Return the index of each sample's 0.2 s window, shape (n,).

    n samples represent n periods: n / (n - 1) times the time from first to last. The
    last window includes the remainder, so that every sample in the mean is checked.
    """
    times = np.array([sample.t_ns for sample in samples], dtype=np.int64)
    count = len(times)
    duration = float(times[-1] - times[0]) * count / (count - 1) if count > 1 else 0.0
    # Half a period of tolerance for jitter of the timestamps.
    grace = duration / count / 2 if count else 0.0
    if duration + grace < MIN_DURATION * NS_PER_S:
        raise TareError(
            f"{count} F/T samples over {duration / NS_PER_S:.2f} s are too few for a "
            f"tare (at least {MIN_DURATION:g} s).",
            hint=_AGAIN,
        )
    window_ns = WINDOW * NS_PER_S
    windows = ((times - times[0]) / window_ns).astype(np.int64)
    whole = int((duration + grace) / window_ns)
    windows = np.minimum(windows, whole - 1)
    fewest = min(int(np.count_nonzero(windows == k)) for k in range(whole))
    if fewest < minimum:
        raise TareError(
            f"Only {fewest} F/T samples in one {WINDOW:g} s of the tare "
            f"(at least {minimum:.0f}).",
            hint=f"Check the sensor's rate and cable. {_AGAIN}",
        )
    return windows


def _force_spread(wrenches: NDArray[np.float64], windows: NDArray[np.int64]) -> float:
    means = np.array(
        [wrenches[windows == k, :3].mean(axis=0) for k in range(windows.max() + 1)]
    )
    return float(np.ptp(means, axis=0).max())
