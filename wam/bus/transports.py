"""Transports of a CAN bus: raw socket for SocketCAN, python-can for other adapters.

Transports never block. Frames carry Linux's flags in the identifier and their time on
the bus by the host's monotonic clock.
"""

import errno
from typing import Final

import can

from acquisition.clock import NS_PER_S, Clock
from acquisition.errors import LinkError
from wam.bus.datagrams import system_call
from wam.bus.error_frames import ERROR_FLAG, EXTENDED_FLAG, REMOTE_FLAG
from wam.bus.link import (
    MAX_DRAINED_FRAMES,
    Frame,
    Transport,
    error_number,
    link_error,
    plausible_times,
)
from wam.bus.socketcan import (
    SocketcanTransport,
    interface_state,
    open_socket,
    setup_command,
)

CanBus = can.BusABC
SOCKETCAN: Final = "socketcan"


def open_bus(interface: str, channel: str, bitrate: int) -> CanBus:
    """Return an open bus of python-can.

    Args:
        interface: python-can's name of the adapter, such as "socketcan".
        channel: the adapter's name, such as "can0".
        bitrate: [bit/s]; a SocketCAN interface has its own and ignores it.

    Raises:
        LinkError: the adapter is missing, down or unknown to python-can.
    """
    try:
        if interface == SOCKETCAN:
            _require_up(channel)
        return can.Bus(interface=interface, channel=channel, bitrate=bitrate)
    except (can.CanError, OSError, ValueError, ImportError) as error:
        raise _cannot_open(interface, channel, bitrate, error) from error


def open_transport(
    interface: str, channel: str, bitrate: int, clock: Clock
) -> Transport:
    """Return an open transport: the kernel's socket for "socketcan", else python-can.

    Args:
        interface: python-can's name of the adapter.
        channel: the adapter's name, such as "can0".
        bitrate: [bit/s]; a SocketCAN interface has its own and ignores it.
        clock: time base of the frames' times.

    Raises:
        LinkError: the adapter is missing, down or unknown.
    """
    if interface != SOCKETCAN:
        return PythonCanTransport(open_bus(interface, channel, bitrate), clock)
    try:
        _require_up(channel)
        return SocketcanTransport(open_socket(channel), channel, clock, system_call())
    except OSError as error:
        raise _cannot_open(interface, channel, bitrate, error) from error


class PythonCanTransport:
    """A bus of python-can; implements `Transport`.

    Adapters stamp frames by UTC, by the monotonic clock [s], or not at all; a timestamp
    plausible by neither clock is discarded.

    Attributes:
        name: name for people.
        lost: 0, python-can does not report losses.
    """

    def __init__(self, bus: CanBus, clock: Clock) -> None:
        """Take ownership of a bus; frame times are by `clock`."""
        self.name = "python-can"
        self.lost = 0
        self._bus = bus
        self._clock = clock
        self._error: Exception | None = None  # raised after the frames before it
        try:
            self._descriptor = bus.fileno()
        except NotImplementedError:
            self._descriptor = -1

    def fileno(self) -> int:
        """Return the bus's descriptor, -1 if it has none."""
        return self._descriptor

    def has_unsent(self) -> bool:
        """Return False: python-can does not report its send queue."""
        return False

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier; raises LinkError."""
        # timestamp, identifier, is_extended_id; positional arguments are faster
        message = can.Message(0.0, can_id, False, data=data)
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            raise link_error(self._bus.channel_info, error) from error

    def receive(self) -> list[Frame]:
        """Return the queued frames, oldest first; raises LinkError."""
        arrived: list[can.Message] = []
        receive = self._bus.recv
        try:
            if self._error is not None:
                error, self._error = self._error, None
                raise error
            while len(arrived) < MAX_DRAINED_FRAMES:
                message = receive(0)
                if message is None:
                    break
                arrived.append(message)
        except (can.CanError, OSError) as error:
            if not arrived:
                raise link_error(self._bus.channel_info, error) from error
            self._error = error
        if not arrived:
            return []
        now_ns = self._clock.now_ns()
        return [self._frame(message, now_ns) for message in arrived]

    def close(self) -> None:
        """Shut the bus down."""
        self._bus.shutdown()

    def _frame(self, message: can.Message, now_ns: int) -> Frame:
        can_id = message.arbitration_id
        if message.is_error_frame:
            can_id |= ERROR_FLAG
        elif message.is_extended_id:
            can_id |= EXTENDED_FLAG
        elif message.is_remote_frame:
            can_id |= REMOTE_FLAG
        stamp = message.timestamp
        t_ns = round(stamp * NS_PER_S) if stamp else 0
        earliest_ns, latest_ns = plausible_times(now_ns)
        if t_ns and not earliest_ns < t_ns <= latest_ns:
            t_ns -= self._clock.utc_ns() - now_ns
            if not earliest_ns < t_ns <= latest_ns:
                t_ns = 0
        return Frame(can_id, bytes(message.data), t_ns)


def _require_up(channel: str) -> None:
    """Raise OSError unless an interface exists and is up."""
    if not interface_state(channel).is_up:
        raise OSError(errno.ENETDOWN, "Network is down")


def _cannot_open(
    interface: str, channel: str, bitrate: int, error: Exception
) -> LinkError:
    up = f"Fix: {setup_command(channel, bitrate)}. Arm not touched."
    if interface == SOCKETCAN and error_number(error) == errno.ENETDOWN:
        return LinkError(f"{channel} is down.", hint=up)
    if interface == SOCKETCAN and error_number(error) == errno.ENODEV:
        return LinkError(
            f"{channel} does not exist.", hint=f"Is the adapter plugged in? {up}"
        )
    return LinkError(
        f"CAN {interface}:{channel} cannot be opened: {error}.",
        hint="Check the interface's name, its driver and its cable. Arm not touched.",
    )
