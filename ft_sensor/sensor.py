"""The wrist sensor as the loop sees it: opened, polled, closed."""

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from acquisition.clock import NS_PER_S, Clock
from acquisition.devices import WrenchSample
from acquisition.errors import (
    DeviceFaultError,
    LinkError,
    LinkTimeoutError,
    SettingsError,
    TractionError,
)
from ft_sensor import bota
from ft_sensor.bota import BootText, BotaFrame, BotaParser, BotaStatus
from ft_sensor.serial_link import SerialLink

MIN_RATE = 495.0  # [Hz]; 500 Hz less what two clocks may disagree
_LISTEN_NS = 3 * NS_PER_S  # a sensor that the opening reset boots within this
_SETTLE_NS = NS_PER_S // 2
_ANSWER_NS = 2 * NS_PER_S
_FIRST_FRAMES_NS = NS_PER_S
_KEYSTROKE_NS = 5_000_000  # the device takes commands no faster
_RESET_NS = 1_500_000_000
_TRIES = 3
_RESETS = 5  # the matrix may need several starts to become active
_PLAUSIBLE_OF_TEN = 8
_MAX_FORCE = 500.0  # [N]; beyond it at rest the numbers are no forces
_MAX_TORQUE = 50.0  # [N m]
_HEARD_SIZE = 2048  # text is looked for in this much of what came last
_FROZEN_NS = 50_000_000  # real noise never repeats six floats that long
_LONGEST_STEP_US = 1_000_000
_UNTRUSTED = BotaStatus.INVALID | BotaStatus.RAW_GAUGE

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class SensorSettings:
    """How a Bota serial sensor is connected and set up.

    Attributes:
        port: path of the serial device.
        baudrate: speed of the line, one of `bota.BAUD_CODES` [bit/s].
        sinc: sinc filter length; the rate is 51200 / sinc [Hz].
        is_fir_on: FIR filter on: cut-off 189 Hz at sinc 64, without it 1255 Hz.
        rate_check: how long the rate is measured after the start [s].
    """

    port: str
    baudrate: int = 460800
    sinc: int = 64
    is_fir_on: bool = True
    rate_check: float = 2.0

    def __post_init__(self) -> None:
        """Refuse what no sensor can do.

        Raises:
            SettingsError: unknown speed, sinc length out of range, or a line too slow
                for the frames.
        """
        if self.baudrate not in bota.BAUD_CODES:
            raise SettingsError(
                f"F/T sensor speed {self.baudrate} baud is unknown.",
                hint=f"Use one of {sorted(bota.BAUD_CODES)}.",
            )
        if not 1 <= self.sinc <= 512 or not 0.1 <= self.rate_check <= 60:
            raise SettingsError(
                f"F/T sensor sinc length {self.sinc} (1 to 512) or rate check "
                f"{self.rate_check} s (0.1 to 60) is out of range.",
                hint="Sinc 64 gives 800 Hz.",
            )
        if self.wire_ns > self.period_ns:
            raise SettingsError(
                f"{self.baudrate} baud carries {NS_PER_S / self.wire_ns:.0f} F/T "
                f"frames a second, sinc {self.sinc} sends {self.rate:.0f}.",
                hint="Raise the speed of the line or the sinc length.",
            )

    @property
    def period_ns(self) -> float:
        """Time between two samples [ns]."""
        return bota.frame_period_ns(self.sinc)

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return NS_PER_S / self.period_ns

    @property
    def wire_ns(self) -> int:
        """Time one frame needs on the line [ns]."""
        return bota.wire_time_ns(bota.FRAME_SIZE, self.baudrate)


@dataclass(frozen=True, slots=True)
class SensorCounters:
    """What happened to the stream since it was opened.

    Attributes:
        frames: good frames.
        crc_errors: failed checksums.
        discarded: bytes that belong to no good frame.
        resyncs: times the stream was lost.
        lost: frames missing by the device's clock.
        frozen: frames whose numbers or clock stood still.
    """

    frames: int
    crc_errors: int
    discarded: int
    resyncs: int
    lost: int
    frozen: int


class BotaSensor:
    """A Bota sensor of generation 1 on a serial line.

    Implements `acquisition.devices.WrenchSensor`. Poll it at least ten times a second:
    the kernel keeps 0.1 s of the stream, and what is read late is dated late.
    """

    def __init__(
        self, link: SerialLink, clock: Clock, settings: SensorSettings
    ) -> None:
        self._link = link
        self._clock = clock
        self._settings = settings
        self._boot = BootText()
        self._rate = 0.0
        self._heard = b""
        self._heard_bytes = 0
        self._answers = 0
        self._parser = BotaParser()
        self._dating = FrameDating(settings)

    def open(self) -> None:
        """Set the sensor up, start its stream and measure its rate.

        Takes boot text or a running stream, for about three seconds; a sensor in
        configuration mode says neither and is spoken to all the same.

        Raises:
            LinkError: the port failed, or bytes came that are not this sensor's.
            LinkTimeoutError: the sensor is silent or does not answer.
            DeviceFaultError: it refused a command, its calibration matrix stays
                inactive, or its rate is below 495 Hz.
        """
        self._wait_for(self._first_sign, _LISTEN_NS)
        if self._boot.is_complete:
            # It takes no commands before its stream runs.
            self._wait_for(self._first_frame, _SETTLE_NS)
        for _ in range(_RESETS):
            self._start()
            if self._is_plausible(self._first_frames()):
                break
            self._reset()
        else:
            raise DeviceFaultError(
                f"The F/T sensor sends raw gauge data or absurd forces after "
                f"{_RESETS} starts (limits {_MAX_FORCE:g} N, {_MAX_TORQUE:g} N m).",
                hint="Take its power away for ten seconds, then open it again.",
            )
        self._rate = self._measure_rate()
        if self._rate < MIN_RATE:
            raise DeviceFaultError(
                f"The F/T sensor sends {self._rate:.1f} Hz, at least {MIN_RATE:g} "
                f"are needed (sinc {self._settings.sinc}).",
                hint="Lower the sinc length (64 gives 800 Hz) or check for bytes lost.",
            )
        self._parser.counters = bota.ParserCounters()
        self._dating = FrameDating(self._settings)

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return what has arrived since the last call, oldest first; does not wait.

        Raises:
            LinkError: the port is closed or gone.
        """
        data = self._link.read_available()
        return self._dating.date(self._parser.feed(data), now_ns) if data else []

    @property
    def counters(self) -> SensorCounters:
        """What happened to the stream since it was opened."""
        parsed = self._parser.counters
        return SensorCounters(
            parsed.frames,
            parsed.crc_errors,
            parsed.discarded,
            parsed.resyncs,
            self._dating.lost,
            self._dating.frozen,
        )

    def describe(self) -> dict[str, str]:
        """Return what the sensor is and how it is set up, as text."""
        settings = self._settings
        fir = "on" if settings.is_fir_on else "off"
        unknown = "unknown (no boot text seen)"
        return {
            "model": "Bota serial, generation 1",
            "name": self._boot.name or unknown,
            "serial_number": self._boot.serial_number or unknown,
            "firmware": self._boot.firmware or unknown,
            "port": settings.port,
            "baudrate": str(settings.baudrate),
            "filter": f"sinc {settings.sinc}, FIR {fir}",
            "nominal_rate": f"{settings.rate:.1f} Hz",
            "measured_rate": f"{self._rate:.1f} Hz",
            "time": "arrival less wire time; filter delay unknown, not subtracted",
        }

    def close(self) -> None:
        """Stop the stream and give the port back; never raises."""
        # A port that is gone or closed has no stream to stop.
        with contextlib.suppress(TractionError):
            self._link.write(bota.CONFIGURE)
        self._link.close()

    # The ritual of opening.

    def _start(self) -> None:
        """Bring the sensor from any mode to a running stream; several tries."""
        for tries_left in reversed(range(_TRIES)):
            try:
                self._configure_and_run()
            except (DeviceFaultError, LinkTimeoutError):
                self._refuse_stranger()
                if not tries_left:
                    raise
            else:
                return

    def _configure_and_run(self) -> None:
        # A sensor already in configuration mode need not answer this one.
        self._ask(bota.CONFIGURE)
        for command in (
            bota.communication_command(self._settings.baudrate),
            bota.filter_command(self._settings.sinc, self._settings.is_fir_on),
            bota.RUN,
        ):
            code = self._ask(command)
            text = command.decode("ascii")
            if code is None:
                raise LinkTimeoutError(
                    f"The F/T sensor did not answer '{text}' within "
                    f"{_ANSWER_NS / NS_PER_S:g} s.",
                    hint="Check the cable in both directions; cycle its power.",
                )
            if code != 0:
                raise DeviceFaultError(
                    f"The F/T sensor refused '{text}' with code {code}.",
                    hint="Check sinc length and speed against its manual.",
                )

    def _ask(self, command: bytes) -> int | None:
        """Send `command`; return the code of its answer, None when there is none."""
        self._heard = b""
        for key in command:
            self._link.write(bytes((key,)))
            self._clock.sleep_until(self._clock.now_ns() + _KEYSTROKE_NS)
        letter = chr(command[0])

        def answer() -> int | None:
            for found in bota.find_acknowledgements(self._heard):
                if found.letter == letter:
                    self._answers += 1
                    return found.code
            return None

        return self._wait_for(answer, _ANSWER_NS)

    def _refuse_stranger(self) -> None:
        """Raise if nothing that came is from a sensor of this kind."""
        if self._answers or self._parser.counters.frames or self._boot.is_started:
            return
        if not self._heard_bytes:
            raise _silent_error()
        raise LinkError(
            f"{self._heard_bytes} bytes from the F/T sensor and no valid frame "
            f"among them.",
            hint=f"Wrong speed (now {self._settings.baudrate} baud) or another "
            "kind of sensor on this port?",
        )

    def _first_sign(self) -> bool | None:
        self._boot = bota.find_boot_text(self._heard)
        return self._boot.is_complete or self._first_frame()

    def _first_frame(self) -> bool | None:
        return self._parser.counters.frames > 0 or None

    def _first_frames(self) -> list[BotaFrame]:
        """Return ten frames or more, fewer when they do not come within a second."""
        frames: list[BotaFrame] = []
        self._wait_for(
            lambda: True if len(frames) >= 10 else None, _FIRST_FRAMES_NS, frames
        )
        if not frames:
            raise _silent_error()
        return frames

    @staticmethod
    def _is_plausible(frames: list[BotaFrame]) -> bool:
        """Return whether most of the first ten frames look like forces."""
        good = [
            not frame.status & BotaStatus.RAW_GAUGE
            and all(abs(force) < _MAX_FORCE for force in frame.wrench[:3])
            and all(abs(torque) < _MAX_TORQUE for torque in frame.wrench[3:])
            for frame in frames[:10]
        ]
        return sum(good) >= _PLAUSIBLE_OF_TEN

    def _reset(self) -> None:
        self._link.write(bota.SOFT_RESET)
        self._clock.sleep_until(self._clock.now_ns() + _RESET_NS)
        self._link.discard_input()

    def _measure_rate(self) -> float:
        """Return the rate [Hz], the lower one by the device's clock and by ours."""
        frames: list[BotaFrame] = []
        start_ns = self._clock.now_ns()
        self._wait_for(
            lambda: None, round(self._settings.rate_check * NS_PER_S), frames
        )
        took_ns = self._clock.now_ns() - start_ns
        if len(frames) < 2:
            raise _silent_error()
        first_us = frames[0].device_us
        span_us = bota.unwrap_us(frames[-1].device_us, first_us) - first_us
        if span_us <= 0:
            raise DeviceFaultError(
                "The clock of the F/T sensor stands still.", hint="Cycle its power."
            )
        return min((len(frames) - 1) * 1e6 / span_us, len(frames) * NS_PER_S / took_ns)

    def _wait_for(
        self,
        found: Callable[[], T | None],
        duration_ns: int,
        frames: list[BotaFrame] | None = None,
    ) -> T | None:
        """Listen until `found` returns something; None after `duration_ns`."""
        deadline_ns = self._clock.now_ns() + duration_ns
        while (result := found()) is None:
            # A device that never pauses keeps the link readable past the deadline.
            if self._clock.now_ns() >= deadline_ns:
                return None
            if self._clock.wait(self._link, deadline_ns):
                self._hear(frames)
        return result

    def _hear(self, frames: list[BotaFrame] | None) -> None:
        data = self._link.read_available()
        self._heard_bytes += len(data)
        self._heard = (self._heard + data)[-_HEARD_SIZE:]
        fresh = self._parser.feed(data)
        if frames is not None:
            frames.extend(fresh)


class FrameDating:
    """Turns frames into dated samples and notices what is missing or frozen.

    The newest frame of a batch left the sensor one wire time before it was read; the
    others lie before it by the differences of the device's clock. Dates only rise.
    """

    def __init__(self, settings: SensorSettings) -> None:
        self.lost = 0
        self.frozen = 0
        self._wire_ns = settings.wire_ns
        self._period_us = settings.period_ns / 1000
        self._device_us: int | None = None
        self._t_ns: int = -(1 << 62)
        self._wrench: bota.Wrench | None = None
        self._unchanged_since_ns = 0

    def date(self, frames: list[BotaFrame], arrival_ns: int) -> list[WrenchSample]:
        """Return the samples of `frames`, all read at `arrival_ns`."""
        steps = [self._step_us(frame) for frame in frames]
        t_ns = arrival_ns - self._wire_ns
        times: list[int] = []
        for step_us in reversed(steps):
            times.append(t_ns)
            # A clock that jumped says nothing about the time between two frames.
            t_ns -= step_us * 1000 if 0 < step_us < _LONGEST_STEP_US else 0
        return [
            self._sample(frame, at_ns, step_us > 0)
            for frame, at_ns, step_us in zip(
                frames, reversed(times), steps, strict=True
            )
        ]

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


def _silent_error() -> LinkTimeoutError:
    # 100 ms is the limit that counts while running; the ritual waits longer.
    return LinkTimeoutError(
        "No F/T data for 100 ms (port open, 0 bytes).", hint="Check power and cable."
    )
