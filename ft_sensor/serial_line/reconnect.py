"""Keeps a serial wrist sensor open: what was lost is looked for and opened again."""

from collections.abc import Callable

from acquisition.clock import NS_PER_S, Clock
from acquisition.devices import WrenchSample
from acquisition.errors import DeviceFaultError, TractionError
from ft_sensor.serial_line.sensor import SerialSensor

LOST_NS = 250_000_000  # without one sample that can be trusted
FIRST_PAUSE_NS = NS_PER_S // 2  # before it is looked for; doubled every time
LONGEST_PAUSE_NS = 4 * NS_PER_S
_UNKNOWN = "unknown"


class ReconnectingSensor:
    """A sensor that survives its cable, its power supply and a restart of its own.

    The loop stops a trial long before a sensor counts as lost here; the next trial
    begins with a tare, as a sensor without power forgets its zero. Only the same sensor
    is taken back: another serial number is refused.

    Attributes:
        reopened: how often it was opened again.
        last_error: why it is not read at present; empty while it is.
    """

    def __init__(self, connect: Callable[[], SerialSensor], clock: Clock) -> None:
        """Take what opens the port; `connect` returns a sensor not opened yet."""
        self.reopened = 0
        self.last_error = ""
        self._connect = connect
        self._clock = clock
        self._sensor: SerialSensor | None = None
        self._facts: dict[str, str] = {}
        self._trusted_ns = 0
        self._pause_ns = FIRST_PAUSE_NS
        self._next_ns = 0

    @property
    def sensor(self) -> SerialSensor | None:
        """The sensor while it is open."""
        return self._sensor

    def open(self) -> dict[str, str]:
        """Open the sensor for the first time; return what it says about itself.

        Raises:
            TractionError: as `SerialSensor.open` and the port.
        """
        self.close()
        self._begin(self._opened())
        return self._facts

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return what has arrived; looks for a lost sensor, which takes seconds."""
        if self._sensor is None:
            self._reconnect(now_ns)
            return []
        try:
            samples = self._sensor.poll(now_ns)
        except TractionError as error:
            self._lose(error.message, now_ns)
            return []
        if any(sample.is_valid for sample in samples):
            self._trusted_ns = now_ns
        elif now_ns - self._trusted_ns > LOST_NS:
            self._lose("no sample that can be trusted for 250 ms", now_ns)
        return samples

    def close(self) -> None:
        """Stop the stream and give the port back; never raises."""
        if self._sensor is not None:
            self._sensor.close()
            self._sensor = None

    def _begin(self, sensor: SerialSensor) -> None:
        self._sensor = sensor
        self._facts = sensor.describe()
        self._trusted_ns = self._clock.now_ns()
        self._pause_ns = FIRST_PAUSE_NS
        self.last_error = ""

    def _opened(self) -> SerialSensor:
        sensor = self._connect()
        try:
            sensor.open()
        except TractionError:
            sensor.close()
            raise
        return sensor

    def _lose(self, why: str, now_ns: int) -> None:
        self.close()
        self.last_error = why
        self._next_ns = now_ns + self._pause_ns

    def _reconnect(self, now_ns: int) -> None:
        if now_ns < self._next_ns:
            return
        try:
            sensor = self._opened()
            self._refuse_another(sensor)
        except TractionError as error:
            self.last_error = error.message
            self._pause_ns = min(2 * self._pause_ns, LONGEST_PAUSE_NS)
            self._next_ns = self._clock.now_ns() + self._pause_ns
            return
        self._begin(sensor)
        self.reopened += 1

    def _refuse_another(self, sensor: SerialSensor) -> None:
        before = self._facts.get("serial_number", _UNKNOWN)
        now = sensor.describe().get("serial_number", _UNKNOWN)
        # A sensor found streaming may not tell.
        if before == now or before.startswith(_UNKNOWN) or now.startswith(_UNKNOWN):
            return
        sensor.close()
        raise DeviceFaultError(
            f"Another F/T sensor was plugged in: {now}, not {before}.",
            hint="Its calibration is another one: end the session and begin anew.",
        )


def stream_metadata(reconnecting: ReconnectingSensor) -> dict[str, str]:
    """Return what became of the stream since it was opened last, as text."""
    fields = {
        "reopened": str(reconnecting.reopened),
        "trouble": reconnecting.last_error,
    }
    if reconnecting.sensor is not None:
        fields |= reconnecting.sensor.stream_metadata()
    return fields
