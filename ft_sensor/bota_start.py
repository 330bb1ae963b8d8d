"""The opening ritual of a Bota sensor: from any mode to a stream to be trusted."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from acquisition.clock import NS_PER_S, Clock
from acquisition.errors import DeviceFaultError, LinkError, LinkTimeoutError
from ft_sensor import bota
from ft_sensor.bota import BootText, BotaFrame, BotaParser, BotaStatus
from ft_sensor.sensor_settings import SensorSettings
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

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class StartedBota:
    """What the ritual found out.

    Attributes:
        boot: the device's own words at power-on; empty if it was running already.
        rate: measured rate [Hz].
    """

    boot: BootText
    rate: float


class BotaStart:
    """Brings one sensor to its stream; `parser` is left in the middle of it."""

    def __init__(
        self,
        link: SerialLink,
        clock: Clock,
        settings: SensorSettings,
        parser: BotaParser,
    ) -> None:
        self._link = link
        self._clock = clock
        self._settings = settings
        self._parser = parser
        self._boot = BootText()
        self._heard = b""
        self._heard_bytes = 0
        self._answers = 0

    def run(self) -> StartedBota:
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
        self._start_until_plausible()
        rate = self._measure_rate()
        if rate < MIN_RATE:
            raise DeviceFaultError(
                f"The F/T sensor sends {rate:.1f} Hz, at least {MIN_RATE:g} "
                f"are needed (sinc {self._settings.sinc}).",
                hint="Lower the sinc length (64 gives 800 Hz) or check for bytes lost.",
            )
        return StartedBota(self._boot, rate)

    def _start_until_plausible(self) -> None:
        for _ in range(_RESETS):
            self._set_up()
            if self._is_plausible(self._first_frames()):
                return
            self._reset()
        raise DeviceFaultError(
            f"The F/T sensor sends raw gauge data or absurd forces after "
            f"{_RESETS} starts (limits {_MAX_FORCE:g} N, {_MAX_TORQUE:g} N m).",
            hint="Take its power away for ten seconds, then open it again.",
        )

    def _set_up(self) -> None:
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


def _silent_error() -> LinkTimeoutError:
    # 100 ms is the limit that counts while running; the ritual waits longer.
    return LinkTimeoutError(
        "No F/T data for 100 ms (port open, 0 bytes).", hint="Check power and cable."
    )
