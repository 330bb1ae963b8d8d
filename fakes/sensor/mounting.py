"""A wrist sensor whose reading differs from its load: rotated, scaled, delayed."""

from collections import deque
from collections.abc import Sequence

from fakes.sensor.stream import Source
from ft_sensor.reading import Wrench
from wam.model.constants import Array


class MountedSensor:
    """The reading of a sensor as a function of time: see `SensorStream`."""

    def __init__(self, source: Source, shown: Array, late_ns: int = 0) -> None:
        """Define the true load and the map from load to reading.

        Args:
            source: the true load in the assumed axes of the sensor [N, N m].
            shown: matrix from the true load to the reading, shape (6, 6).
            late_ns: delay of the reading [ns].
        """
        self._source = source
        self._matrix = shown
        self._late_ns = late_ns
        self._past: deque[tuple[int, Sequence[float]]] = deque()

    def __call__(self, t_ns: int) -> Wrench:
        """Return the reading at `t_ns` [N, N m]."""
        load = self._source(t_ns)
        if self._late_ns:
            load = self._delayed(t_ns, load)
        fx, fy, fz, tx, ty, tz = self._matrix.dot(load).tolist()
        return fx, fy, fz, tx, ty, tz

    def _delayed(self, t_ns: int, load: Sequence[float]) -> Sequence[float]:
        past = self._past
        past.append((t_ns, load))
        while len(past) > 1 and past[1][0] <= t_ns - self._late_ns:
            past.popleft()
        return past[0][1]
