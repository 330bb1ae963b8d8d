"""Automatic reconnection of a serial wrist sensor."""

from collections.abc import Callable

from acquisition.clock import NS_PER_S, Clock
from acquisition.devices import WrenchSample
from acquisition.errors import DeviceFaultError, TractionError
from ft_sensor.serial_line.sensor import SerialSensor

LOST_NS = 250_000_000  # time without a valid sample until the sensor counts as lost
FIRST_PAUSE_NS = NS_PER_S // 2  # pause before the first retry, then doubled
LONGEST_PAUSE_NS = 4 * NS_PER_S
_UNKNOWN = "unknown"


class ReconnectingSensor:
    """A sensor that is reopened after a loss of cable or power, or its own restart.

    The loop stops a trial long before a sensor counts as lost here. The next trial
    begins with a tare, because a sensor loses its zero without power. A sensor with
    another serial number is refused.

    Attributes:
        reopened: number of reconnections.
        last_error: reason for the loss; "" while connected.
    """

    def __init__(self, connect: Callable[[], SerialSensor], clock: Clock) -> None:
        """Prepare; `connect` opens the port and returns a sensor not yet opened."""
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
        """Open the sensor for the first time; return its description.

        Raises:
            TractionError: as `SerialSensor.open` and the port.
        """
        self.close()
        self._begin(self._opened())
        return self._facts

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return new samples; may try to reconnect, which takes seconds."""
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
        """Stop the stream and close the port; never raises."""
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
        # Some sensors do not report it while streaming.
        if before == now or before.startswith(_UNKNOWN) or now.startswith(_UNKNOWN):
            return
        sensor.close()
        raise DeviceFaultError(
            f"Another F/T sensor was plugged in: {now}, not {before}.",
            hint="Its calibration is another one: end the session and begin anew.",
        )


def stream_metadata(reconnecting: ReconnectingSensor) -> dict[str, str]:
    """Return the stream's counters since it was last opened, as text."""
    fields = {
        "reopened": str(reconnecting.reopened),
        "trouble": reconnecting.last_error,
    }
    if reconnecting.sensor is not None:
        fields |= reconnecting.sensor.stream_metadata()
    return fields
