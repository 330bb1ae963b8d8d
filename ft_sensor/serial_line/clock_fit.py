"""The host's time of a device's clock, although its messages arrive late by chance.

Whatever delays a message, it never comes early: of many, the one that waited least
shows how the two clocks stand. A straight line through the least delays of the last
seconds follows two crystals that run apart.
"""

from collections import deque

import numpy as np

WINDOW_NS = 250_000_000  # of which the least delay is kept
SPAN = 32  # windows that the line goes through: 8 s
_FEWEST = 4  # windows for a slope
_KEPT = 0.7  # share of the windows that the line goes through
_STEEPEST = 500e-6  # no two clocks run further apart


class ClockFit:
    """Turns device time into host time; needs no more memory as it goes on.

    Attributes:
        has_line: it follows the difference of the two clocks; before, the least delay.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget everything: the device's clock has jumped."""
        self.least: deque[tuple[int, int]] = deque(maxlen=SPAN)
        self._window: tuple[int, int] | None = None  # device time and offset
        self._begun_ns = 0
        self._origin_ns = 0
        self._offset_ns = 0.0
        self._slope = 0.0
        self.has_line = False

    def offer(self, device_ns: int, arrival_ns: int) -> None:
        """Take a message of the device's time that was there at `arrival_ns`.

        Args:
            device_ns: the device's clock, unwrapped [ns]; it only rises.
            arrival_ns: when the message was there at the latest [monotonic ns].
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
            self._draw_line()
        elif offset < window[1]:
            self._window = (device_ns, offset)
        if not self.has_line:
            self._hold_least()

    def host_ns(self, device_ns: int) -> int:
        """Return when the device's clock showed `device_ns` [monotonic ns].

        Before the first message the offset is unknown: the result is `device_ns`.
        """
        beyond = device_ns - self._origin_ns
        return device_ns + round(self._offset_ns + self._slope * beyond)

    def _hold_least(self) -> None:
        """Before there is a line the least delay so far has to do."""
        assert self._window is not None
        lowest = min((offset for _, offset in self.least), default=self._window[1])
        self._offset_ns = float(min(lowest, self._window[1]))

    def _draw_line(self) -> None:
        """Put the line through the least delays, the longest three in ten left out.

        Delays are only ever too long, so what stands highest above the last line goes:
        a stall does not tilt the new one.
        """
        if len(self.least) < _FEWEST:
            return
        self._origin_ns = self.least[-1][0]
        points = np.array(self.least, dtype=np.int64)
        base = int(points[-1, 1])
        t = (points[:, 0] - self._origin_ns).astype(float)
        y = (points[:, 1] - base).astype(float)
        rest = y - self._slope * t
        kept = rest <= np.quantile(rest, _KEPT)
        slope, offset = _line(t[kept], y[kept])
        self._slope = float(np.clip(slope, -_STEEPEST, _STEEPEST))
        self._offset_ns = base + offset
        self.has_line = True


def _line(t: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return (slope, value at 0) of the least-squares line."""
    centred = t - t.mean()
    power = float(centred @ centred)
    slope = float(centred @ y) / power if power > 0.0 else 0.0
    return slope, float(y.mean() - slope * t.mean())
