"""The wrist sensor as a cycle uses it: its newest valid sample, and how old that is."""

from collections.abc import Callable

from acquisition.clock import NS_PER_MS
from acquisition.devices import WrenchSample, WrenchSensor
from acquisition.errors import LinkError


class WrenchFeed:
    """Drains a sensor and keeps what a cycle needs of it.

    Attributes:
        newest: the newest sample that the device vouches for; None = none yet.
        since_ns: when it was taken, or when the waiting began [ns]; 0 = not polled.
    """

    def __init__(
        self,
        sensor: WrenchSensor,
        on_wrenches: Callable[[list[WrenchSample]], None],
    ) -> None:
        self._sensor = sensor
        self._on_wrenches = on_wrenches
        self.newest: WrenchSample | None = None
        self.since_ns = 0

    def poll(self, now_ns: int, stale_ms: float) -> bool:
        """Drain the sensor; return whether the newest sample is not older than that.

        A port that is gone is a sensor that is silent: its last sample grows old.
        """
        try:
            samples = self._sensor.poll(now_ns)
        except LinkError:
            samples = []
        if samples:
            self._on_wrenches(samples)
            for sample in reversed(samples):
                if sample.is_valid:
                    self.newest, self.since_ns = sample, sample.t_ns
                    break
        if self.since_ns == 0:
            self.since_ns = now_ns
        age_ns = now_ns - self.since_ns
        return self.newest is not None and age_ns <= stale_ms * NS_PER_MS
