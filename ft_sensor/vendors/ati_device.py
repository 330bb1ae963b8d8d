"""Driver part of ATI network sensors: start and stop of the stream, settings."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from acquisition.clock import NS_PER_S
from acquisition.errors import (
    DeviceFaultError,
    LinkTimeoutError,
    SettingsError,
)
from acquisition.settings import Number, UsualRange, Whole
from ft_sensor.network.datagrams import DatagramPort, parse_address
from ft_sensor.reading import Reading, StreamTiming, Wrench
from ft_sensor.section import SensorSection
from ft_sensor.serial_line.framing import FrameScanner, wire_time_ns
from ft_sensor.serial_line.link import OpenedPort, PortSettings
from ft_sensor.serial_line.startup import SerialDialog, silent_error
from ft_sensor.vendors import ati

NETWORK = 100_000_000  # bit/s, fast Ethernet
RATE = 1000  # Hz, to be set on its web page
_FROZEN_NS = 50_000_000  # noisy 32-bit counts never repeat for that long
_STUCK_NS = 250_000_000  # the same for a single axis
_ANSWER_NS = NS_PER_S // 2
_QUIET_NS = 100_000_000  # for packets in transit after the stop
_TRIES = 3  # requests may be lost


@dataclass(frozen=True, slots=True)
class AtiSettings:
    """Settings as on the sensor's web page.

    Attributes:
        counts_per_force: counts per N.
        counts_per_torque: counts per N m.
        ranges: measuring ranges fx fy fz tx ty tz [N, N m].
        rate: record rate [Hz].
    """

    counts_per_force: float
    counts_per_torque: float
    ranges: Wrench
    rate: int = RATE

    @property
    def counts(self) -> Wrench:
        """Counts per N and N m of each axis."""
        force, torque = self.counts_per_force, self.counts_per_torque
        return force, force, force, torque, torque, torque


class AtiDevice:
    """Implements `ft_sensor.serial_line.sensor.SerialDevice` for RDT.

    RDT does not acknowledge requests: success shows only by the end and start of the
    stream. Settings cannot be read; they are given in rig.toml.
    """

    stop = ati.encode_request(ati.STOP)

    def __init__(self, line: PortSettings, settings: AtiSettings) -> None:
        period_ns = NS_PER_S / settings.rate
        self.line = line
        self.ranges = settings.ranges
        self.timing = StreamTiming(
            period_ns=period_ns,
            wire_ns=wire_time_ns(ati.FRAME_SIZE, line.baudrate),
            modulus=ati.MODULUS,
            tick_ns=period_ns,
            frozen_ns=_FROZEN_NS,
            stuck_ns=_STUCK_NS,
            frame_size=ati.FRAME_SIZE,
        )
        self._settings = settings

    def scanner(self) -> FrameScanner[Reading]:
        """Return a scanner for the records of the stream."""
        return ati.RdtScanner(self._settings.counts, self.ranges)

    def status_texts(self, status: int) -> tuple[str, ...]:
        """Return the meanings of the set bits of `status`."""
        return ati.status_texts(status)

    def start(self, dialog: SerialDialog) -> dict[str, str]:
        """Stop a running stream, if any, and start a new one.

        Raises:
            LinkError: the network failed.
            LinkTimeoutError: the sensor is silent, or does not stop streaming.
            DeviceFaultError: it reports a failure.
        """
        self._end_stream(dialog)
        for _ in range(_TRIES):
            dialog.write(ati.encode_request(ati.STREAM))
            before = dialog.frames
            if dialog.wait_for(lambda b=before: dialog.frames > b or None, _ANSWER_NS):
                break
        else:
            raise silent_error()
        self._refuse_failure(dialog.first_readings())
        return {
            "model": "ATI network F/T sensor, RDT",
            "serial_number": "unknown (RDT does not tell it)",
            "firmware": "unknown (RDT does not tell it)",
            "filter": "unknown (as its web page is set)",
            "time": "number of the packet, fitted to arrival; filter unknown",
        }

    def _end_stream(self, dialog: SerialDialog) -> None:
        for _ in range(_TRIES):
            dialog.write(self.stop)
            dialog.pause(_QUIET_NS)
            dialog.discard()
            before = dialog.frames
            dialog.wait_for(lambda b=before: dialog.frames > b or None, _QUIET_NS)
            if dialog.frames == before:
                return
        raise LinkTimeoutError(
            f"The F/T sensor did not answer: it streams although it was told to stop "
            f"{_TRIES} times.",
            hint="Does another program read it? Cycle its power.",
        )

    def _refuse_failure(self, readings: list[Reading]) -> None:
        faulty = next((r for r in reversed(readings) if not r.is_trusted), None)
        if faulty is not None:
            words = ", ".join(self.status_texts(faulty.status))
            raise DeviceFaultError(
                f"The F/T sensor reports: {words} (status 0x{faulty.status:08x}).",
                hint="Its web page tells more; check the cable of the transducer.",
            )


_Force = Annotated[Number, Field(ge=1, le=100_000), UsualRange(0.05, 50_000.0, "N")]
_Torque = Annotated[
    Number, Field(ge=0.01, le=10_000), UsualRange(0.005, 5_000.0, "N m")
]
_Counts = Annotated[Number, Field(gt=0, le=1e9)]


class AtiSection(SensorSection):
    """[ft_sensor] of an ATI sensor on the network; see `AtiSettings`."""

    kind: Literal["ati"] = Field(examples=["ati"])
    port: str = Field(examples=["192.168.1.1"])
    baudrate: Whole = Field(
        default=NETWORK, gt=0, le=10_000_000_000, examples=[NETWORK]
    )
    rate: Whole = Field(default=RATE, ge=500, le=8000, examples=[RATE])
    counts_per_force: _Counts | None = Field(default=None, examples=[1_000_000.0])
    counts_per_torque: _Counts | None = Field(default=None, examples=[1_000_000.0])
    ranges: tuple[_Force, _Force, _Force, _Torque, _Torque, _Torque] | None = Field(
        default=None, examples=[[130.0, 130.0, 400.0, 10.0, 10.0, 10.0]]
    )

    def known_ranges(self) -> Wrench | None:
        """Return the measuring ranges [N, N m], None if not given."""
        return self.ranges

    def open_port(self, port: str) -> OpenedPort:
        """Open a UDP port to the sensor at the address `port`.

        Raises:
            SettingsError: not a valid address.
            LinkError: no route to the address.
        """
        address = parse_address(port, ati.PORT)
        return OpenedPort(DatagramPort(address, ati.FRAME_SIZE), "")

    def build(self, line: PortSettings) -> AtiDevice:
        """Return the sensor on `line`.

        Raises:
            SettingsError: a setting from its web page is missing.
        """
        scales = self.counts_per_force, self.counts_per_torque
        if scales[0] is None or scales[1] is None or self.ranges is None:
            raise SettingsError(
                "an ati needs counts_per_force, counts_per_torque and ranges, e.g. "
                "counts_per_force = 1000000.0, counts_per_torque = 1000000.0, ranges = "
                "[130.0, 130.0, 400.0, 10.0, 10.0, 10.0].",
                hint="They stand on its web page, under configurations.",
            )
        settings = AtiSettings(scales[0], scales[1], self.ranges, self.rate)
        return AtiDevice(line, settings)
