"""Clock fit: maps a device's clock to the host's in spite of random message delays.

Delays are never negative, so the smallest delay of many messages gives the offset of
the two clocks. A straight line through the smallest delays of the last seconds tracks
the drift of the two oscillators.
"""

from collections import deque

import numpy as np

WINDOW_NS = 250_000_000  # window of which the smallest delay is kept
SPAN = 32  # windows in the fit: 8 s
_FEWEST = 4  # windows for a slope
_KEPT = 0.7  # share of the windows used for the line
_STEEPEST = 500e-6  # largest rate difference of two clocks


class ClockFit:
    """Conversion of device time to host time in bounded memory.

    Attributes:
        has_line: the drift is fitted; before, only the smallest delay is used.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Reset after a jump of the device's clock."""
        self.least: deque[tuple[int, int]] = deque(maxlen=SPAN)
        self._window: tuple[int, int] | None = None  # device time and offset
        self._begun_ns = 0
        self._origin_ns = 0
        self._offset_ns = 0.0
        self._slope = 0.0
        self.has_line = False

    def offer(self, device_ns: int, arrival_ns: int) -> None:
        """Add a message of the device's time received at `arrival_ns`.

        Args:
            device_ns: unwrapped device clock [ns], not decreasing.
            arrival_ns: latest possible time of arrival [monotonic ns].
        """
        offset = arrival_ns - device_ns
        window = self._window
        if window is None:
            self._begun_ns = device_ns
            self._window = (device_ns, offset)
        elif device_ns - self._begun_ns >= WINDOW_NS:
            self.least.append(window)
            self._begun_ns = device_ns
            self._window = (device_ns, offset)
            self._fit_line()
        elif offset < window[1]:
            self._window = (device_ns, offset)
        if not self.has_line:
            self._use_least_delay()

    def host_ns(self, device_ns: int) -> int:
        """Return the host time of device time `device_ns` [monotonic ns].

        Before the first message the offset is unknown: the result is `device_ns`.
        """
        beyond = device_ns - self._origin_ns
        return device_ns + round(self._offset_ns + self._slope * beyond)

    def _use_least_delay(self) -> None:
        """Set the offset to the smallest delay so far; used until a line is fitted."""
        assert self._window is not None
        lowest = min((offset for _, offset in self.least), default=self._window[1])
        self._offset_ns = float(min(lowest, self._window[1]))

    def _fit_line(self) -> None:
        """Fit the line to the smallest 70 % of the window minima.

        Delays are one-sided, so the largest residuals from the last line are left out:
        a stall then does not tilt the new line.
        """
        if len(self.least) < _FEWEST:
            return
        self._origin_ns = self.least[-1][0]
        points = np.array(self.least, dtype=np.int64)
        base = int(points[-1, 1])
        t = (points[:, 0] - self._origin_ns).astype(float)
        y = (points[:, 1] - base).astype(float)
        residuals = y - self._slope * t
        kept = residuals <= np.quantile(residuals, _KEPT)
        slope, offset = _least_squares_line(t[kept], y[kept])
        self._slope = float(np.clip(slope, -_STEEPEST, _STEEPEST))
        self._offset_ns = base + offset
        self.has_line = True


def _least_squares_line(t: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return (slope, value at 0) of the least-squares line."""
    centred = t - t.mean()
    power = float(centred @ centred)
    slope = float(centred @ y) / power if power > 0.0 else 0.0
    return slope, float(y.mean() - slope * t.mean())
