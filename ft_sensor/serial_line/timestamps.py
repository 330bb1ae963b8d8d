"""Timestamps of a wrist sensor, synchronised to the host clock, and its validity."""

import math

from acquisition.devices import WrenchSample
from ft_sensor.reading import Reading, StreamTiming, Wrench
from ft_sensor.serial_line.clock_fit import WINDOW_NS, ClockFit

LONGEST_STEP_NS = 1_000_000_000  # a larger step of the device's clock is a jump
_UNSEEN = 0.75  # periods of delay throughout a window: a frame was lost
_SILENT_NS = 30_000_000  # longer than an adapter buffers
_FEWEST = 20  # samples in a span for a verdict on an axis
_ALIKE = 0.1  # relative difference of a pause by device and host clock


class DeviceClock:
    """Time base of a device with a clock or frame counter.

    Attributes:
        lost: samples missing by the device's clock or counter.
        jumps: jumps of the clock: the device was restarted and has lost its settings.
    """

    def __init__(self, timing: StreamTiming) -> None:
        self.lost = 0
        self.jumps = 0
        self._timing = timing
        self._ticks: int | None = None
        self._arrival_ns = 0

    def steps(
        self, readings: list[Reading], arrival_ns: int, discarded: int
    ) -> list[int]:
        """Return the time step of each reading [ns]; 0 or less = a jump.

        Also counts missing samples. `discarded` (damaged bytes) is not used, the
        device's counter is more precise.
        """
        del discarded
        if not readings:
            return []
        waited_ns, self._arrival_ns = arrival_ns - self._arrival_ns, arrival_ns
        return [self._step(reading.ticks, waited_ns) for reading in readings]

    def _step(self, ticks: int, waited_ns: int) -> int:
        timing, last = self._timing, self._ticks
        if last is None:
            self._ticks = ticks
            return round(timing.period_ns)
        self._ticks = timing.unwrap(ticks, last)
        step_ns = round((self._ticks - last) * timing.tick_ns)
        if step_ns > LONGEST_STEP_NS and abs(step_ns - waited_ns) > _ALIKE * step_ns:
            self.jumps += 1
            return 0
        self.jumps += step_ns < 0
        self.lost += max(round(step_ns / timing.period_ns) - 1, 0)
        return step_ns


class FrameCounter:
    """Time base of a device without clock and counter: frames are counted.

    Damaged bytes and long silence reveal lost frames at once. An unnoticed loss delays
    every later frame by whole periods relative to the count and is corrected then.

    Attributes:
        lost: samples assumed missing.
        jumps: always 0.
    """

    def __init__(self, timing: StreamTiming) -> None:
        self.lost = 0
        self.jumps = 0
        self._timing = timing
        self._arrival_ns = 0
        self._is_begun = False
        self._discarded = 0
        self._begun_ns: int | None = None
        self._least_ns = 0

    def steps(
        self, readings: list[Reading], arrival_ns: int, discarded: int
    ) -> list[int]:
        """Return the time step of each reading [ns]."""
        self._discarded += discarded
        if not readings:
            return []
        period_ns = self._timing.period_ns
        missing = round(self._discarded / self._timing.frame_size)
        self._discarded = 0
        waited_ns, self._arrival_ns = arrival_ns - self._arrival_ns, arrival_ns
        silent_ns = waited_ns - len(readings) * period_ns
        if self._is_begun and silent_ns > _SILENT_NS:
            missing = max(missing, round(silent_ns / period_ns))
        self._is_begun = True
        self.lost += missing
        first = round((1 + missing) * period_ns)
        return [first] + [round(period_ns)] * (len(readings) - 1)

    def correct(self, excess_ns: int, device_ns: int) -> int:
        """Return the correction of the count [ns].

        Args:
            excess_ns: delay of a frame relative to its count [ns].
            device_ns: count of the frame [ns].
        """
        period_ns = self._timing.period_ns
        if excess_ns < -_UNSEEN * period_ns:  # too early: too many were assumed lost
            periods = round(excess_ns / period_ns)
        elif self._begun_ns is None:
            self._begun_ns, self._least_ns = device_ns, excess_ns
            return 0
        else:
            self._least_ns = min(self._least_ns, excess_ns)
            if device_ns - self._begun_ns < WINDOW_NS:
                return 0
            least_ns, self._begun_ns = self._least_ns, None
            if least_ns < _UNSEEN * period_ns:
                return 0
            periods = round(least_ns / period_ns)
        self._begun_ns = None
        self.lost = max(self.lost + periods, 0)
        return round(periods * period_ns)


class StuckAxes:
    """Detects axes that repeat one value while others change.

    An axis that keeps its value throughout a span is stuck until the value changes.
    Noise clears all six axes within the first samples of a span, so the check is cheap.
    Exact zeros are excluded (an axis that the sensor does not measure), and so are
    saturated axes.
    """

    def __init__(self, span_ns: int) -> None:
        """Set the length of a span [ns]; 0 = no check."""
        self._span_ns = span_ns
        self._begun_ns = 0
        self._first_wrench: Wrench | None = None
        self._compared = 0
        self._still: list[int] = []
        self._stuck: list[int] = []

    def are_there(self, reading: Reading, t_ns: int) -> bool:
        """Return whether an axis is stuck, given the next reading."""
        first = self._first_wrench
        if first is None or t_ns - self._begun_ns >= self._span_ns:
            return self._begin(reading, t_ns)
        if self._still:
            wrench = reading.wrench
            self._compared += 1
            self._still = [axis for axis in self._still if wrench[axis] == first[axis]]
            self._stuck = [axis for axis in self._stuck if axis in self._still]
        return bool(self._stuck)

    def _begin(self, reading: Reading, t_ns: int) -> bool:
        """End a span at a reading and begin the next one."""
        wrench, first = reading.wrench, self._first_wrench
        if first is not None and self._compared >= _FEWEST:
            self._stuck = [
                axis
                for axis in self._still
                if wrench[axis] == first[axis] != 0.0
                and not reading.saturated >> axis & 1
            ]
        self._begun_ns, self._first_wrench, self._compared = t_ns, wrench, 0
        self._still = list(range(len(wrench))) if self._span_ns else []
        return bool(self._stuck)


class SampleTimestamper:
    """Converts readings to timestamped samples; detects losses and frozen values.

    The newest reading of a batch left the sensor at least one wire time before it was
    read; the others precede it by differences of the device's clock. A `ClockFit`
    removes random delays. Timestamps increase strictly. After a jump of its clock the
    device was restarted and has to be reopened: its samples are invalid.

    Attributes:
        frozen: readings with frozen values or clock.
    """

    def __init__(self, timing: StreamTiming) -> None:
        self.frozen = 0
        self._timing = timing
        self._device = DeviceClock(timing) if timing.modulus else FrameCounter(timing)
        self._device_ns = 0
        self._fit = ClockFit()
        self._t_ns: int = -(1 << 62)
        self._wrench: Wrench | None = None
        self._unchanged_since_ns = 0
        self._stuck = StuckAxes(timing.stuck_ns)

    @property
    def lost(self) -> int:
        """Samples missing by the device's clock or counter."""
        return self._device.lost

    @property
    def jumps(self) -> int:
        """Restarts of the device by its clock; later samples are invalid."""
        return self._device.jumps

    def date(
        self, readings: list[Reading], arrival_ns: int, discarded: int = 0
    ) -> list[WrenchSample]:
        """Return the samples of `readings`, all received at `arrival_ns`.

        `discarded`: bytes outside good frames in the same read.
        """
        steps = self._device.steps(readings, arrival_ns, discarded)
        if not readings:
            return []
        # After a jump the time between two frames is unknown.
        intervals = [step if 0 < step < LONGEST_STEP_NS else 0 for step in steps[1:]]
        t_ns = arrival_ns - self._timing.wire_ns - sum(intervals)
        samples: list[WrenchSample] = []
        for reading, step_ns, next_ns in zip(
            readings, steps, [*intervals, 0], strict=True
        ):
            dated_ns = self._fitted_time(t_ns, step_ns)
            samples.append(self._sample(reading, dated_ns, step_ns > 0))
            t_ns += next_ns
        return samples

    def _fitted_time(self, latest_ns: int, step_ns: int) -> int:
        """Return the send time of a frame, at most `latest_ns` [monotonic ns]."""
        if not 0 < step_ns < LONGEST_STEP_NS:
            self._fit.restart()
        self._device_ns += max(step_ns, 0)
        fit = self._fit
        device = self._device
        if isinstance(device, FrameCounter) and fit.has_line:
            excess_ns = latest_ns - fit.host_ns(self._device_ns)
            self._device_ns += device.correct(excess_ns, self._device_ns)
        fit.offer(self._device_ns, latest_ns)
        return min(latest_ns, fit.host_ns(self._device_ns))

    def _sample(self, reading: Reading, t_ns: int, is_running: bool) -> WrenchSample:
        if t_ns <= self._t_ns:
            t_ns = self._t_ns + 1
        self._t_ns = t_ns
        wrench = reading.wrench
        if wrench != self._wrench:
            self._wrench = wrench
            self._unchanged_since_ns = t_ns
        is_live = (
            is_running
            and not self._device.jumps
            and t_ns - self._unchanged_since_ns < self._timing.frozen_ns
            and not self._stuck.are_there(reading, t_ns)
        )
        self.frozen += not is_live
        # The sum of six 32-bit floats cannot overflow: finite if and only if all are.
        is_number = math.isfinite(sum(wrench))
        is_valid = is_live and reading.is_trusted and is_number
        return WrenchSample(
            t_ns, reading.ticks, wrench, reading.status, is_valid, reading.saturated
        )
