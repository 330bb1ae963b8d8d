"""Barrett's wrist sensor: node 8 of the arm's bus, polled along with the positions."""

from dataclasses import asdict, dataclass
from typing import Literal

from pydantic import Field

from acquisition.clock import Clock
from acquisition.devices import WrenchSample
from acquisition.errors import DeviceFaultError, LinkTimeoutError
from acquisition.settings import Whole
from ft_sensor.reading import Wrench
from ft_sensor.section import SensorSection
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.vendors.barrett_frames import (
    RANGES,
    BarrettCounters,
    WrenchPairing,
    status_texts,
)
from wam.bus.frames import SENSOR_NODE, Payload, encode_get
from wam.bus.link import Link
from wam.bus.properties import Device, PuckRole, PuckStatus, property_number
from wam.bus.property_client import PropertyClient

_GET_FT = encode_get(property_number(Device.SENSOR, "FT"))
_VERS, _ROLE, _SN, _STAT = 0, 1, 2, 5  # the same asleep and awake
_MS = 1_000_000
_WAKE_NS = 10 * _MS
_BOOT_NS = 1_000 * _MS  # no traffic while the transceiver powers up
_ANSWER_NS = 50 * _MS  # the sensor answers within 1 ms; a slow adapter adds latency
_QUESTIONS = 20  # requests of the start-up check


@dataclass(frozen=True, slots=True)
class _Identity:
    """Identity reported by node 8; None = not reported."""

    role: int | None = None
    vers: int | None = None
    serial_number: int | None = None
    answered: int = 0


class BarrettSensor:
    """The force/torque sensor on a WAM's bus.

    Implements `WrenchSensor` and, for the arm's driver, `BusDevice`: the driver sends
    its requests and passes received frames to it.

    Attributes:
        counters: counters of replies and errors.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self.counters = BarrettCounters()
        self._link = link
        self._clock = clock
        self._properties = PropertyClient(link, clock)
        self._identity = _Identity()
        self._pairing = WrenchPairing(self.counters)
        self._inbox: list[WrenchSample] = []

    def open(self) -> None:
        """Wake the sensor if necessary and check its replies; the loop must not run.

        The arm's start-up wakes it with the pucks; opened before that, it is woken
        here. ROLE and VERS are not checked, because old firmware reports wrong values:
        replies to force and torque requests decide. No tare command is sent.

        Raises:
            LinkTimeoutError: node 8 is silent, or sends no force and torque.
            DeviceFaultError: it does not wake up, or reports saturated gauges.
            LinkError: the bus is down.
        """
        self._wake()
        role, vers, serial_number = (
            self._properties.get(SENSOR_NODE, number) for number in (_ROLE, _VERS, _SN)
        )
        first = self._exchange()
        if first is None:
            raise LinkTimeoutError(
                f"Node 8 answers, but sends no force and torque ({_role_text(role)}).",
                hint="Is it a force/torque sensor? Else correct ft_sensor.kind.",
            )
        if first.status:
            raise DeviceFaultError(
                f"The F/T sensor reports: {', '.join(status_texts(first.status))}.",
                hint="Take the load off the foot, then switch the arm off and on.",
            )
        answered = 1 + sum(self._exchange() is not None for _ in range(1, _QUESTIONS))
        self._identity = _Identity(role, vers, serial_number, answered)

    def poll_frame(self, t_ns: int) -> tuple[int, bytes]:
        """Return identifier and payload of the request sent at `t_ns`."""
        self._pairing.ask(t_ns)
        return SENSOR_NODE, _GET_FT

    def on_frame(self, can_id: int, data: Payload) -> None:
        """Handle a frame of the bus; all but force and torque are ignored."""
        sample = self._pairing.on_frame(can_id, data)
        if sample is not None:
            self._inbox.append(sample)

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return the samples since the last call, oldest first."""
        samples, self._inbox = self._inbox, []
        return samples

    def describe(self) -> dict[str, str]:
        """Return the sensor's identity as text."""
        identity = self._identity
        return {
            "model": "Barrett force/torque sensor, node 8",
            "serial_number": _text(identity.serial_number),
            "firmware": f"{_text(identity.vers)} (unreliable)",
            "role": _role_text(identity.role),
            "port": "the arm's CAN bus",
            "ranges": " ".join(f"{limit:g}" for limit in RANGES),
            "nominal_rate": "one sample per cycle",
            "measured_rate": f"{identity.answered} of {_QUESTIONS} questions answered",
            "time": "question handed over + 191 us; filter delay unknown",
        }

    def stream_metadata(self) -> dict[str, str]:
        """Return the counters of replies, as text."""
        return {name: str(value) for name, value in asdict(self.counters).items()}

    def close(self) -> None:
        """Drop pending samples; the bus belongs to the arm's driver."""
        self._inbox = []

    def _wake(self) -> None:
        stat = self._properties.get(SENSOR_NODE, _STAT)
        if stat is None:
            raise LinkTimeoutError(
                "The F/T sensor (node 8) does not answer on the arm's bus.",
                hint="Check its cable and the arm's power, or ft_sensor.kind.",
            )
        if stat == PuckStatus.RESET:
            self._properties.set(SENSOR_NODE, _STAT, PuckStatus.READY)
            self._properties.pause(_WAKE_NS + _BOOT_NS)
            stat = self._properties.get(SENSOR_NODE, _STAT)
        if stat != PuckStatus.READY:
            raise DeviceFaultError(
                f"The F/T sensor (node 8) is not ready: STAT {_text(stat)}, not 2.",
                hint="Switch the arm off and on, then start again.",
            )

    def _exchange(self) -> WrenchSample | None:
        """Request a sample outside the loop; None after a timeout."""
        self._properties.drain()
        now_ns = self._clock.now_ns()
        deadline_ns = now_ns + _ANSWER_NS
        self._link.send(*self.poll_frame(now_ns))
        while self._clock.wait(self._link, deadline_ns):
            for frame in self._link.receive():
                self.on_frame(frame.can_id, frame.data)
            if self._inbox:
                return self._inbox.pop()
            if self._clock.now_ns() >= deadline_ns:
                break
        return None


def _text(value: int | None) -> str:
    return "unknown" if value is None else str(value)


def _role_text(role: int | None) -> str:
    if role is None:
        return "ROLE unknown"
    is_usual = role & 0x1F == PuckRole.FORCE
    return f"ROLE {role:#06x}" + (
        "" if is_usual else f", usually {PuckRole.FORCE:#06x}"
    )


class BarrettSection(SensorSection):
    """[ft_sensor] of a sensor on the arm's bus, without line and options."""

    kind: Literal["barrett"] = Field(examples=["barrett"])
    port: str = Field(default="none", examples=["none"])
    baudrate: Whole = Field(default=1_000_000, gt=0, le=4_000_000, examples=[1_000_000])

    def known_ranges(self) -> Wrench:
        """Return the measuring ranges [N, N m]."""
        return RANGES

    @property
    def is_on_bus(self) -> bool:
        """Whether the sensor is polled on the arm's bus and has no port."""
        return True

    def build(self, line: PortSettings) -> None:
        """Return None: the arm's driver polls the sensor."""
