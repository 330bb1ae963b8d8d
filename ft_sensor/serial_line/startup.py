"""What the start-up of all serial sensors shares: commands, answers, frame rate."""

from collections.abc import Callable
from typing import TypeVar

from acquisition.clock import NS_PER_S, RATE_HZ, Clock
from acquisition.errors import DeviceFaultError, LinkError, LinkTimeoutError
from ft_sensor.reading import Reading, StreamTiming
from ft_sensor.serial_line.framing import FrameScanner
from ft_sensor.serial_line.link import SerialLink

MIN_RATE = 0.99 * RATE_HZ  # [Hz]; less by what two clocks may disagree
FIRST_READINGS = 10
_FIRST_NS = NS_PER_S
_BUFFER_SIZE = 2048  # answers are looked for in this much of what came last

T = TypeVar("T")


class SerialDialog:
    """Commands to a sensor, and their answers in what may be a running stream.

    Attributes:
        buffer: the last bytes that came since `discard`, or since the last write.
        received_bytes: how many came in all.
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
        """Send `data`; answers are looked for in what comes from now on.

        Raises:
            LinkError: the port failed.
        """
        self.buffer = b""
        self._link.write(data)

    def pause(self, duration_ns: int) -> None:
        """Let time pass; what comes meanwhile stays in the port."""
        self._clock.sleep_until(self._clock.now_ns() + duration_ns)

    def discard(self) -> None:
        """Discard all input so far."""
        self._link.discard_input()
        self.buffer = b""

    def wait_for(
        self,
        condition: Callable[[], T | None],
        duration_ns: int,
        readings: list[Reading] | None = None,
    ) -> T | None:
        """Listen until `condition` returns something; None after `duration_ns`.

        `readings` collects the frames that come meanwhile.
        """
        deadline_ns = self._clock.now_ns() + duration_ns
        while (result := condition()) is None:
            # A device that never pauses keeps the link readable past the deadline.
            if self._clock.now_ns() >= deadline_ns:
                return None
            if self._clock.wait(self._link, deadline_ns):
                self._receive(readings)
        return result

    def first_readings(self) -> list[Reading]:
        """Return ten readings or more, fewer when they do not come within a second.

        Raises:
            LinkTimeoutError: none came, or none that was whole.
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
        """Raise: no answer came, and not one good frame.

        Raises:
            LinkTimeoutError: nothing came at all.
            LinkError: bytes came, and none of them are this sensor's.
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
        """Return the rate [Hz], the lower one by the device's clock and by ours.

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
    """Return the error for a port that is open and brings nothing."""
    # 100 ms is the limit that counts while running; a start-up waits longer.
    return LinkTimeoutError(
        "No F/T data for 100 ms (port open, 0 bytes).", hint="Check power and cable."
    )
