"""A wrist sensor that shows another load than it bears: turned, scaled, late."""

from collections import deque
from collections.abc import Sequence

from fakes.sensor.stream import Source
from ft_sensor.reading import Wrench
from wam.model.constants import Array


class MountedSensor:
    """The load that a sensor shows, as a function of time: see `SensorStream`."""

    def __init__(self, source: Source, shown: Array, late_ns: int = 0) -> None:
        """Take what it bears, and how it shows that.

        Args:
            source: the true load in the axes that it is taken to have [N, N m].
            shown: what it shows of the true load, shape (6, 6).
            late_ns: how much older the load that it shows is [ns].
        """
        self._source = source
        self._shown = shown
        self._late_ns = late_ns
        self._past: deque[tuple[int, Sequence[float]]] = deque()

    def __call__(self, t_ns: int) -> Wrench:
        """Return the load that is shown at `t_ns` [N, N m]."""
        borne = self._source(t_ns)
        if self._late_ns:
            borne = self._older(t_ns, borne)
        fx, fy, fz, tx, ty, tz = self._shown.dot(borne).tolist()
        return fx, fy, fz, tx, ty, tz

    def _older(self, t_ns: int, borne: Sequence[float]) -> Sequence[float]:
        past = self._past
        past.append((t_ns, borne))
        while len(past) > 1 and past[1][0] <= t_ns - self._late_ns:
            past.popleft()
        return past[0][1]
