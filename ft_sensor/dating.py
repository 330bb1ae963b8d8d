"""When the frames of a wrist sensor were taken, and whether they can be trusted."""

import math

from acquisition.devices import WrenchSample
from ft_sensor import bota
from ft_sensor.bota import BotaFrame, BotaStatus
from ft_sensor.clock_fit import ClockFit
from ft_sensor.sensor_settings import SensorSettings

_FROZEN_NS = 50_000_000  # real noise never repeats six floats that long
_LONGEST_STEP_US = 1_000_000
_UNTRUSTED = BotaStatus.INVALID | BotaStatus.RAW_GAUGE


class FrameDating:
    """Turns frames into dated samples and notices what is missing or frozen.

    The newest frame of a batch left the sensor one wire time before it was read, at
    the latest; the others lie before it by the differences of the device's clock. What
    delayed them by chance is taken out by a `ClockFit`. Dates only rise.
    """

    def __init__(self, settings: SensorSettings) -> None:
        self.lost = 0
        self.frozen = 0
        self._wire_ns = settings.wire_ns
        self._period_us = settings.period_ns / 1000
        self._device_us: int | None = None
        self._clock = ClockFit()
        self._t_ns: int = -(1 << 62)
        self._wrench: bota.Wrench | None = None
        self._unchanged_since_ns = 0

    def date(self, frames: list[BotaFrame], arrival_ns: int) -> list[WrenchSample]:
        """Return the samples of `frames`, all read at `arrival_ns`."""
        shown = [(self._step_us(frame), self._device_us or 0) for frame in frames]
        t_ns = arrival_ns - self._wire_ns
        times: list[int] = []
        for step_us, _ in reversed(shown):
            times.append(t_ns)
            # A clock that jumped says nothing about the time between two frames.
            t_ns -= step_us * 1000 if 0 < step_us < _LONGEST_STEP_US else 0
        return [
            self._sample(frame, self._fitted(at_ns, *clock), clock[0] > 0)
            for frame, at_ns, clock in zip(frames, reversed(times), shown, strict=True)
        ]

    def _fitted(self, latest_ns: int, step_us: int, device_us: int) -> int:
        """Return when a frame was sent, `latest_ns` at the latest [monotonic ns]."""
        if not 0 < step_us < _LONGEST_STEP_US:
            self._clock.restart()
        device_ns = 1000 * device_us
        self._clock.offer(device_ns, latest_ns)
        return min(latest_ns, self._clock.host_ns(device_ns))

    def _step_us(self, frame: BotaFrame) -> int:
        """Return the device time since the frame before; counts what it shows lost."""
        if self._device_us is None:
            self._device_us = frame.device_us
            return round(self._period_us)
        now_us = bota.unwrap_us(frame.device_us, self._device_us)
        step_us = now_us - self._device_us
        self._device_us = now_us
        self.lost += max(round(step_us / self._period_us) - 1, 0)
        return step_us

    def _sample(
        self, frame: BotaFrame, t_ns: int, is_clock_running: bool
    ) -> WrenchSample:
        t_ns = max(t_ns, self._t_ns + 1)
        self._t_ns = t_ns
        if frame.wrench != self._wrench:
            self._wrench = frame.wrench
            self._unchanged_since_ns = t_ns
        is_live = is_clock_running and t_ns - self._unchanged_since_ns < _FROZEN_NS
        self.frozen += not is_live
        return WrenchSample(
            t_ns=t_ns,
            counter=frame.device_us,
            wrench=frame.wrench,
            status=frame.status,
            is_valid=is_live
            and not frame.status & _UNTRUSTED
            and all(map(math.isfinite, frame.wrench)),
            is_saturated=bool(frame.status & BotaStatus.OVER_RANGE),
        )
