"""The bytes that a wrist sensor sends, as a function of simulated time only.

`SensorStream` is the device: gauges, clock, line and their faults; its `Firmware` is
the vendor-specific part. Time is an argument; nothing here waits.
"""

from collections import deque
from collections.abc import Callable, Sequence

from fakes.sensor.errors import PER_DEGREE, SensorErrors
from fakes.sensor.firmware import Firmware, Measurement, SampleSchedule, TimedBytes
from fakes.sensor.stream_faults import ByteFault, StreamFaults, damage
from ft_sensor.reading import ALL_AXES, Wrench
from ft_sensor.serial_line.framing import wire_time_ns

Source = Callable[[int], Sequence[float]]

ROOM = 25.0  # ambient temperature [degrees Celsius]
_NO_RANGES: Wrench = (1e9, 1e9, 1e9, 1e9, 1e9, 1e9)


class SensorStream:
    """A wrist sensor seen from its end of the wire.

    `source(t_ns)` is the true load at a time: fx fy fz tx ty tz in the sensor frame
    [N, N m]. It is called once per sample, in order of time, when `due` reaches the
    time of the sample.

    Attributes:
        errors: errors added to the load; None = none. A constant load without errors
            repeats bit for bit, which drivers rightly report as a frozen sensor.
        ranges: measuring ranges of the gauges [N, N m].
        status: status bits set in every frame, besides the device's own.
        is_clock_frozen: the device's clock and counter stand still.
        faults: faults of its values and frames.
        resets_on_open: opening the port reboots it.
        warming: rate of warming, which moves its zero [degrees Celsius per s].
    """

    def __init__(
        self,
        firmware: Firmware,
        source: Source,
        errors: SensorErrors | None = None,
        start_ns: int = 0,
        clock_start_us: int = 0,
    ) -> None:
        """Switch the device on at `start_ns`, unless its firmware already runs."""
        self.errors = errors
        self.ranges = _NO_RANGES
        self.status = 0
        self.is_clock_frozen = False
        self.faults = StreamFaults()
        self.resets_on_open = False
        self.warming = 0.0
        self.firmware = firmware
        self._source = source
        self._pending: deque[TimedBytes] = deque()
        self._wire_free_ns = self._paused_until_ns = start_ns
        self._is_silent = self._is_skipping = self._is_saturated = False
        self._fault: tuple[ByteFault, int] | None = None
        self.on_since_ns = firmware.on_since_ns
        self._clock_start_us = self._device_us = clock_start_us
        self._number = 0
        self._schedule: SampleSchedule | None = None
        if firmware.schedule is None:
            self.reset(start_ns)
        self._follow_schedule()

    def reset(self, t_ns: int) -> None:
        """Power-cycle the device at `t_ns`; settings are lost."""
        outputs = self.firmware.power_up(t_ns)
        self._restart_line()
        self._send_outputs(outputs)

    def port_opened(self, t_ns: int) -> None:
        """Notify the device that its port was opened."""
        if self.resets_on_open:
            self.reset(t_ns)

    def receive(self, t_ns: int, data: bytes) -> None:
        """Handle bytes written by the client at `t_ns`."""
        self._sample_until(t_ns)
        outputs = self.firmware.receive(t_ns, data)
        if self.firmware.on_since_ns != self.on_since_ns:
            self._restart_line()
        self._send_outputs(outputs)

    def due(self, t_ns: int) -> list[TimedBytes]:
        """Return (time [ns], bytes) of all output sent by `t_ns`, in order."""
        if self._schedule is not None and self._sample_ns <= t_ns:
            self._sample_until(t_ns)
        pending = self._pending
        sent: list[TimedBytes] = []
        while pending and pending[0][0] <= t_ns:
            sent.append(pending.popleft())
        return sent

    def next_event_ns(self) -> int | None:
        """Return when the next output will be sent [ns]; None = never."""
        if self._pending:
            return self._pending[0][0]
        if self._schedule is None or self._is_silent:
            return None
        return self._sample_ns + self._frame_wire_ns

    def go_silent(self) -> None:
        """Send nothing until `speak`, as with a cut cable."""
        self._is_silent = True
        self._pending.clear()

    def speak(self) -> None:
        """End the silence."""
        self._is_silent = False

    def pause(self, until_ns: int) -> None:
        """Lose the samples before `until_ns`; the device's clock continues."""
        self._paused_until_ns = until_ns

    def damage_next(self, fault: ByteFault, index: int) -> None:
        """Damage byte `index` of the next frame on the wire."""
        self._fault = (fault, index)

    def jump_clock(self, step_us: int) -> None:
        """Advance the device's clock, and a counter of milliseconds, by `step_us`."""
        self._clock_start_us += step_us
        self._number += step_us // 1000

    def saturate(self) -> None:
        """Report every axis as saturated, until `recover`."""
        self._is_saturated = True

    def recover(self) -> None:
        """Clear every fault except lasting ones: an unplugged cable, a reboot."""
        self.speak()
        self.status = 0
        self.is_clock_frozen = self._is_saturated = False
        self.faults.clear_faults()
        self.ranges = _NO_RANGES
        self.warming = 0.0

    def _restart_line(self) -> None:
        """Restart clock, counter and line at power-on."""
        self.on_since_ns = self._wire_free_ns = self.firmware.on_since_ns
        self._pending.clear()
        self._is_skipping = False
        self._number = 0

    def _send_outputs(self, outputs: list[TimedBytes]) -> None:
        for send_ns, data in outputs:
            self._send(send_ns, data)
        self._follow_schedule()

    def _follow_schedule(self) -> None:
        """Restart the samples if the firmware has a new schedule."""
        schedule = self.firmware.schedule
        if schedule is self._schedule:
            return
        self._schedule = schedule
        self._count = 0
        self._frame_wire_ns = wire_time_ns(
            self.firmware.frame_size, self.firmware.baudrate
        )
        if schedule is not None:
            self._sample_ns = schedule.first_ns

    def _sample_until(self, t_ns: int) -> None:
        schedule = self._schedule
        while schedule is not None and self._sample_ns <= t_ns:
            self._take_sample(self._sample_ns, schedule.period_ns)
            self._count += 1
            self._sample_ns = schedule.first_ns + round(
                self._count * schedule.period_ns
            )

    def _take_sample(self, t_ns: int, period_ns: float) -> None:
        wrench = self._source(t_ns)
        if self.errors is not None:
            wrench = self.errors.apply(t_ns, wrench)
        if not self.is_clock_frozen:
            self._number += 1
        if self._is_silent or t_ns < self._paused_until_ns:
            return  # sent into a cut cable
        if self._wire_free_ns > t_ns + period_ns:
            self._is_skipping = True  # the line is too slow for the rate
            return
        undamaged = data = self.firmware.frame(
            self._measurement(t_ns, wrench), self.status
        )
        self._is_skipping = False
        if self._fault is not None:
            data = damage(data, *self._fault)
            self._fault = None
        data = self.faults.carry(data)
        if data == undamaged or not self.firmware.drops_damaged_frames:
            self._send(t_ns, data)

    def _measurement(self, t_ns: int, wrench: Sequence[float]) -> Measurement:
        warmth = 0.0 if self.errors is None else self.errors.warmth
        if self.warming:
            heated = self.warming * (t_ns - self.on_since_ns) * 1e-9
            warmth += heated
            pairs = zip(wrench, PER_DEGREE, strict=True)
            wrench = [value + heated * gain for value, gain in pairs]
        saturated = ALL_AXES if self._is_saturated else 0
        if self.ranges is not _NO_RANGES:
            wrench, clipped_axes = _clipped(wrench, self.ranges)
            saturated |= clipped_axes
        fx, fy, fz, tx, ty, tz = wrench
        if not self.is_clock_frozen:
            elapsed_ns = round((t_ns - self.on_since_ns) * self.firmware.clock_rate)
            self._device_us = self._clock_start_us + elapsed_ns // 1000
        return Measurement(
            self.faults.show((fx, fy, fz, tx, ty, tz)),
            saturated,
            self._device_us,
            self._number,
            self._is_skipping,
            ROOM + warmth,
        )

    def _send(self, t_ns: int, data: bytes) -> None:
        """Send `data` as soon as the line is free, not before `t_ns`."""
        if self._is_silent:
            return
        wire_ns = wire_time_ns(len(data), self.firmware.baudrate)
        begin_ns = t_ns if t_ns > self._wire_free_ns else self._wire_free_ns
        self._wire_free_ns = end_ns = begin_ns + wire_ns
        self._pending.append((end_ns, data))


def _clipped(wrench: Sequence[float], ranges: Wrench) -> tuple[list[float], int]:
    """Return `wrench` clipped to `ranges`, and a bit mask of the clipped axes."""
    clipped: list[float] = []
    saturated = 0
    for axis, (value, limit) in enumerate(zip(wrench, ranges, strict=True)):
        if abs(value) >= limit:
            saturated |= 1 << axis
        clipped.append(min(max(value, -limit), limit))
    return clipped, saturated
