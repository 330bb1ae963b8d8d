"""Start-up dialog of serial sensors: commands, replies, frame rate."""

from collections.abc import Callable
from typing import TypeVar

from acquisition.clock import NS_PER_S, RATE_HZ, Clock
from acquisition.errors import DeviceFaultError, LinkError, LinkTimeoutError
from ft_sensor.reading import Reading, StreamTiming
from ft_sensor.serial_line.framing import FrameScanner
from ft_sensor.serial_line.link import SerialLink

MIN_RATE = 0.99 * RATE_HZ  # [Hz]; 1 % tolerance for the difference of two clocks
FIRST_READINGS = 10
_FIRST_NS = NS_PER_S
_BUFFER_SIZE = 2048  # last bytes, searched for replies

T = TypeVar("T")


class SerialDialog:
    """Commands to a sensor, with replies possibly embedded in a running stream.

    Attributes:
        buffer: last bytes received since `discard` or the last write.
        received_bytes: total number of bytes received.
    """

    def __init__(
        self, link: SerialLink, clock: Clock, scanner: FrameScanner[Reading]
    ) -> None:
        self.buffer = b""
        self.received_bytes = 0
        self._link = link
        self._clock = clock
        self._scanner = scanner

    @property
    def frames(self) -> int:
        """Good frames so far."""
        return self._scanner.counters.frames

    def write(self, data: bytes) -> None:
        """Send `data` and clear the buffer for its reply.

        Raises:
            LinkError: the port failed.
        """
        self.buffer = b""
        self._link.write(data)

    def pause(self, duration_ns: int) -> None:
        """Wait without reading the port."""
        self._clock.sleep_until(self._clock.now_ns() + duration_ns)

    def discard(self) -> None:
        """Discard all received data."""
        self._link.discard_input()
        self.buffer = b""

    def wait_for(
        self,
        condition: Callable[[], T | None],
        duration_ns: int,
        readings: list[Reading] | None = None,
    ) -> T | None:
        """Receive until `condition` returns a value; None after `duration_ns`.

        Frames received in the meantime are appended to `readings`.
        """
        deadline_ns = self._clock.now_ns() + duration_ns
        while (result := condition()) is None:
            # With a continuous stream the link stays readable past the deadline.
            if self._clock.now_ns() >= deadline_ns:
                return None
            if self._clock.wait(self._link, deadline_ns):
                self._receive(readings)
        return result

    def first_readings(self) -> list[Reading]:
        """Return ten readings or more, or those of one second.

        Raises:
            LinkTimeoutError: no reading was received.
        """
        readings: list[Reading] = []
        before = self.received_bytes
        self.wait_for(
            lambda: True if len(readings) >= FIRST_READINGS else None,
            _FIRST_NS,
            readings,
        )
        if not readings and self.received_bytes > before:
            raise LinkTimeoutError(
                f"No whole F/T frame in {self.received_bytes - before} bytes.",
                hint="Check the cable and what runs beside it.",
            )
        if not readings:
            raise silent_error()
        return readings

    def raise_no_reply(self, baudrate: int) -> None:
        """Raise the error for a sensor without replies and good frames.

        Raises:
            LinkTimeoutError: no data were received.
            LinkError: data were received, but no frame of this sensor.
        """
        if not self.received_bytes:
            raise silent_error()
        raise LinkError(
            f"{self.received_bytes} bytes from the F/T sensor and no valid frame "
            f"among them.",
            hint=f"Wrong speed (now {baudrate} baud) or another kind of sensor on "
            "this port?",
        )

    def measure_rate(self, timing: StreamTiming, seconds: float) -> float:
        """Return the frame rate [Hz], the lower one by device clock and host clock.

        Raises:
            LinkTimeoutError: the stream is silent.
            DeviceFaultError: the device's clock stands still, or the rate is too low.
        """
        readings: list[Reading] = []
        start_ns = self._clock.now_ns()
        self.wait_for(lambda: None, round(seconds * NS_PER_S), readings)
        took_ns = self._clock.now_ns() - start_ns
        if len(readings) < 2:
            raise silent_error()
        rates = [len(readings) * NS_PER_S / took_ns]
        if timing.modulus:
            first = readings[0].ticks
            passed = timing.unwrap(readings[-1].ticks, first) - first
            if passed <= 0:
                raise DeviceFaultError(
                    "The clock of the F/T sensor stands still.", hint="Cycle its power."
                )
            rates.append((len(readings) - 1) * NS_PER_S / (passed * timing.tick_ns))
        rate = min(rates)
        if rate < MIN_RATE:
            raise DeviceFaultError(
                f"The F/T sensor sends {rate:.1f} Hz, at least {MIN_RATE:g} "
                f"are needed (set to {NS_PER_S / timing.period_ns:.1f}).",
                hint="Raise its rate in rig.toml or check for bytes lost.",
            )
        return rate

    def _receive(self, readings: list[Reading] | None) -> None:
        data = self._link.read_available()
        self.received_bytes += len(data)
        self.buffer = (self.buffer + data)[-_BUFFER_SIZE:]
        fresh = self._scanner.feed(data)
        if readings is not None:
            readings.extend(fresh)


def silent_error() -> LinkTimeoutError:
    """Return the error for an open port without data."""
    # 100 ms is the limit in the running loop; the start-up waits longer.
    return LinkTimeoutError(
        "No F/T data for 100 ms (port open, 0 bytes).",
        hint="Check the sensor's power and cable.",
    )
