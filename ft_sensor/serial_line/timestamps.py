"""When the samples of a wrist sensor were taken, and whether they can be trusted."""

import math

from acquisition.devices import WrenchSample
from ft_sensor.reading import Reading, StreamTiming, Wrench
from ft_sensor.serial_line.clock_fit import WINDOW_NS, ClockFit

LONGEST_STEP_NS = 1_000_000_000  # a clock that moves further at once has jumped
_UNSEEN = 0.75  # periods too late, for a whole window: a frame was lost unseen
_SILENT_NS = 30_000_000  # longer than an adapter collects bytes
_FEWEST = 20  # samples of a span that says something of an axis
_ALIKE = 0.1  # share by which a pause of the device and of the host may differ


class DeviceClock:
    """The time of a device that shows a clock or counts its frames.

    Attributes:
        lost: samples missing by the device's own count.
        jumps: times it showed something else than time that had passed: the device
            was restarted and has lost the settings of its opening.
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
        """Return the time since the reading before, for each [ns]; 0 or less: jumped.

        What is missing is counted. `discarded`: damaged bytes among the readings; the
        device's own count tells more.
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
    """The time of a device that shows none: its frames are counted.

    Damaged bytes and long silence tell of lost frames at once. A loss without a sign
    makes every later frame arrive whole periods after the time it is counted for, and
    is put right then.

    Attributes:
        lost: samples taken to be missing.
        jumps: none; there is nothing that could jump.
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
        """Return the time since the reading before, for each [ns]."""
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
        """Return what has to be added to the count [ns].

        Args:
            excess_ns: by which a frame came later than its count says [ns].
            device_ns: its count [ns].
        """
        period_ns = self._timing.period_ns
        if excess_ns < -_UNSEEN * period_ns:  # no frame comes before it was sent
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
    """Notices axes that repeat one number while others change.

    Span by span: an axis that shows throughout a span what it showed at its beginning
    is stuck until it shows something else. Noise clears all six with the first samples
    of a span; what is left of it costs nothing. Exactly zero is what a sensor shows
    that does not measure an axis, and a number beyond the range is told as saturated.
    """

    def __init__(self, span_ns: int) -> None:
        """Take how long a span is [ns]; 0 = nothing is judged."""
        self._span_ns = span_ns
        self._begun_ns = 0
        self._shown: Wrench | None = None
        self._compared = 0
        self._still: list[int] = []
        self._stuck: list[int] = []

    def are_there(self, reading: Reading, t_ns: int) -> bool:
        """Return whether an axis is stuck at a reading, the next one in order."""
        shown = self._shown
        if shown is None or t_ns - self._begun_ns >= self._span_ns:
            return self._begin(reading, t_ns)
        if self._still:
            wrench = reading.wrench
            self._compared += 1
            self._still = [axis for axis in self._still if wrench[axis] == shown[axis]]
            self._stuck = [axis for axis in self._stuck if axis in self._still]
        return bool(self._stuck)

    def _begin(self, reading: Reading, t_ns: int) -> bool:
        """End a span with a reading, and begin the next one."""
        wrench, shown = reading.wrench, self._shown
        if shown is not None and self._compared >= _FEWEST:
            self._stuck = [
                axis
                for axis in self._still
                if wrench[axis] == shown[axis] != 0.0
                and not reading.saturated >> axis & 1
            ]
        self._begun_ns, self._shown, self._compared = t_ns, wrench, 0
        self._still = list(range(len(wrench))) if self._span_ns else []
        return bool(self._stuck)


class SampleTimestamper:
    """Turns readings into dated samples and notices what is missing or frozen.

    The newest reading of a batch left the sensor one wire time before it was read, at
    the latest; the others lie before it by the differences of the device's clock. What
    delayed them by chance is taken out by a `ClockFit`. Dates only rise. A device whose
    clock jumped was restarted and has to be opened again: its samples are not valid.

    Attributes:
        frozen: readings whose numbers or clock stood still, or cannot be trusted.
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
        """Samples missing by the device's clock or count."""
        return self._device.lost

    @property
    def jumps(self) -> int:
        """Times the device was restarted, by its clock; nothing is valid from then."""
        return self._device.jumps

    def date(
        self, readings: list[Reading], arrival_ns: int, discarded: int = 0
    ) -> list[WrenchSample]:
        """Return the samples of `readings`, all read at `arrival_ns`.

        `discarded`: bytes among them that belonged to no good frame.
        """
        steps = self._device.steps(readings, arrival_ns, discarded)
        if not readings:
            return []
        # A clock that jumped says nothing about the time between two frames.
        apart = [step if 0 < step < LONGEST_STEP_NS else 0 for step in steps[1:]]
        t_ns = arrival_ns - self._timing.wire_ns - sum(apart)
        samples: list[WrenchSample] = []
        for reading, step_ns, next_ns in zip(readings, steps, [*apart, 0], strict=True):
            dated_ns = self._fitted(t_ns, step_ns)
            samples.append(self._sample(reading, dated_ns, step_ns > 0))
            t_ns += next_ns
        return samples

    def _fitted(self, latest_ns: int, step_ns: int) -> int:
        """Return when a frame was sent, `latest_ns` at the latest [monotonic ns]."""
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
        # Of six numbers of 32 bits no sum overflows: it is finite if all of them are.
        is_number = math.isfinite(sum(wrench))
        is_valid = is_live and reading.is_trusted and is_number
        return WrenchSample(
            t_ns, reading.ticks, wrench, reading.status, is_valid, reading.saturated
        )
