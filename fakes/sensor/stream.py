"""The bytes a wrist sensor sends, as a function of simulated time and of nothing else.

`SensorStream` is the device behind the wire: gauges, clock, line and what can go wrong
with them. What is particular to a make is its `Firmware`. Told the time, never waits.
"""

from collections import deque
from collections.abc import Callable, Sequence

from fakes.sensor.errors import PER_DEGREE, SensorErrors
from fakes.sensor.firmware import Firmware, Measurement, SampleSchedule, Saying
from fakes.sensor.stream_faults import ByteFault, StreamFaults, damage
from ft_sensor.reading import ALL_AXES, Wrench
from ft_sensor.serial_line.framing import wire_time_ns

Source = Callable[[int], Sequence[float]]

ROOM = 25.0  # where it stands [degrees Celsius]
_NO_RANGES: Wrench = (1e9, 1e9, 1e9, 1e9, 1e9, 1e9)


class SensorStream:
    """A wrist sensor seen from its end of the wire.

    `source(t_ns)` is the true load at an instant: fx fy fz tx ty tz in the sensor frame
    [N, N m]. It is called once per sample, in order of time, when `due` reaches the
    instant of the sample.

    Attributes:
        errors: added to the load; None = shown as it is. A constant load without
            errors repeats bit for bit, which drivers rightly take for a frozen sensor.
        ranges: where the gauges end [N, N m].
        status: status bits set in every frame, beside those the device sets itself.
        is_clock_frozen: the device's clock and counter stand still.
        faults: what goes wrong with its numbers and its frames.
        resets_on_open: opening the port boots it.
        warming: how fast it warms up, which moves its zero [degrees Celsius per s].
    """

    def __init__(
        self,
        firmware: Firmware,
        source: Source,
        errors: SensorErrors | None = None,
        start_ns: int = 0,
        clock_start_us: int = 0,
    ) -> None:
        """Switch the device on at `start_ns`, or find it running."""
        self.errors = errors
        self.ranges = _NO_RANGES
        self.status = 0
        self.is_clock_frozen = False
        self.faults = StreamFaults()
        self.resets_on_open = False
        self.warming = 0.0
        self.firmware = firmware
        self._source = source
        self._pending: deque[Saying] = deque()
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
        """Switch the power off and on at `t_ns`; settings are lost."""
        sayings = self.firmware.power_up(t_ns)
        self._begin_anew()
        self._say(sayings)

    def port_opened(self, t_ns: int) -> None:
        """Tell the device that its port was opened."""
        if self.resets_on_open:
            self.reset(t_ns)

    def receive(self, t_ns: int, data: bytes) -> None:
        """Take bytes written by the client at `t_ns`."""
        self._sample_until(t_ns)
        sayings = self.firmware.receive(t_ns, data)
        if self.firmware.on_since_ns != self.on_since_ns:
            self._begin_anew()
        self._say(sayings)

    def due(self, t_ns: int) -> list[Saying]:
        """Return (time, bytes) of all that has left the wire by `t_ns`, in order."""
        if self._schedule is not None and self._sample_ns <= t_ns:
            self._sample_until(t_ns)
        pending = self._pending
        gone: list[Saying] = []
        while pending and pending[0][0] <= t_ns:
            gone.append(pending.popleft())
        return gone

    def next_event_ns(self) -> int | None:
        """Return when the next bytes will have left the wire; None = never."""
        if self._pending:
            return self._pending[0][0]
        if self._schedule is None or self._is_silent:
            return None
        return self._sample_ns + self._frame_wire_ns

    def go_silent(self) -> None:
        """Say nothing from now on, until `speak`: a cut cable."""
        self._is_silent = True
        self._pending.clear()

    def speak(self) -> None:
        """End the silence."""
        self._is_silent = False

    def pause(self, until_ns: int) -> None:
        """Lose the samples before `until_ns`; the device's clock goes on."""
        self._paused_until_ns = until_ns

    def damage_next(self, fault: ByteFault, index: int) -> None:
        """Damage byte `index` of the next frame on the wire."""
        self._fault = (fault, index)

    def jump_clock(self, step_us: int) -> None:
        """Let the device's clock, and a counter of milliseconds, go `step_us` ahead."""
        self._clock_start_us += step_us
        self._number += step_us // 1000

    def saturate(self) -> None:
        """Report every axis as beyond its range, until `recover`."""
        self._is_saturated = True

    def recover(self) -> None:
        """End every fault but what is lost for good: a pulled cable, a reboot."""
        self.speak()
        self.status = 0
        self.is_clock_frozen = self._is_saturated = False
        self.faults.clear_faults()
        self.ranges = _NO_RANGES
        self.warming = 0.0

    def _begin_anew(self) -> None:
        """Let clock, counter and line begin with the power."""
        self.on_since_ns = self._wire_free_ns = self.firmware.on_since_ns
        self._pending.clear()
        self._is_skipping = False
        self._number = 0

    def _say(self, sayings: list[Saying]) -> None:
        for say_ns, data in sayings:
            self._send(say_ns, data)
        self._follow_schedule()

    def _follow_schedule(self) -> None:
        """Begin the samples of a new schedule of the firmware."""
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
            return  # sent all the same, into a cable that is cut
        if self._wire_free_ns > t_ns + period_ns:
            self._is_skipping = True  # the line is too slow for the rate
            return
        whole = data = self.firmware.frame(self._measured(t_ns, wrench), self.status)
        self._is_skipping = False
        if self._fault is not None:
            data = damage(data, *self._fault)
            self._fault = None
        data = self.faults.carry(data)
        if data == whole or not self.firmware.is_checked:
            self._send(t_ns, data)

    def _measured(self, t_ns: int, wrench: Sequence[float]) -> Measurement:
        warmth = 0.0 if self.errors is None else self.errors.warmth
        if self.warming:
            heated = self.warming * (t_ns - self.on_since_ns) * 1e-9
            warmth += heated
            pairs = zip(wrench, PER_DEGREE, strict=True)
            wrench = [value + heated * gain for value, gain in pairs]
        saturated = ALL_AXES if self._is_saturated else 0
        if self.ranges is not _NO_RANGES:
            wrench, beyond = _clipped(wrench, self.ranges)
            saturated |= beyond
        fx, fy, fz, tx, ty, tz = wrench
        if not self.is_clock_frozen:
            passed_ns = round((t_ns - self.on_since_ns) * self.firmware.clock_rate)
            self._device_us = self._clock_start_us + passed_ns // 1000
        return Measurement(
            self.faults.show((fx, fy, fz, tx, ty, tz)),
            saturated,
            self._device_us,
            self._number,
            self._is_skipping,
            ROOM + warmth,
        )

    def _send(self, t_ns: int, data: bytes) -> None:
        """Put `data` on the wire as soon as it is free, not before `t_ns`."""
        if self._is_silent:
            return
        wire_ns = wire_time_ns(len(data), self.firmware.baudrate)
        begin_ns = t_ns if t_ns > self._wire_free_ns else self._wire_free_ns
        self._wire_free_ns = end_ns = begin_ns + wire_ns
        self._pending.append((end_ns, data))


def _clipped(wrench: Sequence[float], ranges: Wrench) -> tuple[list[float], int]:
    """Return `wrench` cut at `ranges`, and the axes that were, one bit each."""
    shown: list[float] = []
    saturated = 0
    for axis, (value, most) in enumerate(zip(wrench, ranges, strict=True)):
        if abs(value) >= most:
            saturated |= 1 << axis
        shown.append(min(max(value, -most), most))
    return shown, saturated
