"""The one door to python-can: a bus that is sent to and drained, never waited on."""

import errno
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import can

from acquisition import NS_PER_S, Clock, LinkError, LinkFullError, utc_offset_ns
from acquisition.ipc import FrameTape
from wam.bus.error_frames import BusErrors
from wam.bus.frames import SAFETY_NODE, SENDER_MASK, Group, compose_id

MODE_BROADCAST_ID = compose_id(SAFETY_NODE, Group.BUS, is_group=True)
_FULL = frozenset({errno.ENOBUFS, errno.EAGAIN})  # a queue, a socket's buffer
_DRAIN_AT_MOST = 512  # frames; no flood may keep the loop here


class Frame(NamedTuple):
    """A frame as received or sent.

    Attributes:
        can_id: 11-bit identifier.
        data: payload.
        stamp: time of arrival by the bus's own clock [s], 0.0 = it has none.
    """

    can_id: int
    data: bytes
    stamp: float


Tap = Callable[[Sequence[tuple[int, bytes, float]]], None]  # each like a Frame


class Link(Protocol):
    """Frames out, frames in; what a driver needs of a bus."""

    @property
    def mode_hints(self) -> int:
        """Number of changes of mode that the safety module has announced."""
        ...

    @property
    def errors(self) -> BusErrors:
        """What error frames of the controller reported."""
        ...

    @property
    def foreign_id(self) -> int | None:
        """Identifier of the first frame of another master; None = none ever came."""
        ...

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a frame; raises LinkError when the bus refuses it."""
        ...

    def receive(self) -> list[Frame]:
        """Return what has arrived, oldest first; never waits."""
        ...

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if there is none."""
        ...

    def is_readable(self) -> bool:
        """Return whether `receive` would return something."""
        ...

    def close(self) -> None:
        """Give the bus back."""
        ...


CanBus = can.BusABC  # for modules that may not know python-can


def open_bus(interface: str, channel: str, bitrate: int) -> can.BusABC:
    """Return an open bus of python-can.

    Args:
        interface: python-can's name of the adapter, such as "socketcan".
        channel: the adapter's name, such as "can0".
        bitrate: [bit/s]; a SocketCAN interface has its own and ignores it.

    Raises:
        LinkError: the adapter is missing, down or unknown to python-can.
    """
    bus: can.BusABC | None = None
    try:
        bus = can.Bus(interface=interface, channel=channel, bitrate=bitrate)
        bus.recv(0)  # an interface that is down says so at the first look only
    except (can.CanError, OSError, ValueError, ImportError) as error:
        if bus is not None:
            bus.shutdown()
        raise _cannot_open(interface, channel, bitrate, error) from error
    return bus


class CanLink:
    """A python-can bus seen by the driver: sent to, drained, never waited on.

    Frames of hosts (FROM = 0, the own ones included), remote, extended and error
    frames are dropped. The safety module's broadcast of a change of mode has no known
    content: it is counted in `mode_hints` and dropped. A bus does not return what was
    sent through it, so a frame of a host that arrives is another master's.

    Attributes:
        mode_hints: broadcasts of the safety module so far.
        errors: what error frames of the controller reported.
        foreign_ids: identifiers of hosts' frames that have arrived so far.
        foreign_id: the first of them; None = none has.
    """

    def __init__(self, bus: CanBus, tap: Tap | None = None) -> None:
        """Take a bus over.

        Args:
            bus: of python-can.
            tap: takes every data frame with an 11-bit identifier, sent or received;
                all that have arrived at once together.
        """
        self._tap = tap
        self.mode_hints = 0
        self.errors = BusErrors()
        self.foreign_ids: set[int] = set()
        self.foreign_id: int | None = None
        self._bus = bus
        self._inbox: list[Frame] = []
        self._is_open = True
        try:
            self._descriptor = bus.fileno()
        except NotImplementedError:
            self._descriptor = -1

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier.

        Raises:
            LinkError: the bus is down, full or closed.
        """
        if not self._is_open:
            raise LinkError("The CAN bus is closed.", hint="Start again.")
        # positionally: stamp, identifier, is it an extended one
        message = can.Message(0.0, can_id, False, data=data)
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            raise _broken(self._bus.channel_info, error) from error
        if self._tap is not None:
            self._tap(((can_id, data, 0.0),))

    def receive(self) -> list[Frame]:
        """Return the device frames that have arrived, oldest first.

        Raises:
            LinkError: the bus is down.
        """
        self._drain()
        frames, self._inbox = self._inbox, []
        return frames

    def fileno(self) -> int:
        """Return the bus's descriptor, -1 if it has none."""
        return self._descriptor if self._is_open else -1

    def is_readable(self) -> bool:
        """Return whether a device frame has arrived; a dead bus has none."""
        if not self._inbox:
            try:
                self._drain()
            except LinkError:
                return False
        return bool(self._inbox)

    def close(self) -> None:
        """Give the bus back; a second call does nothing."""
        if self._is_open:
            self._is_open = False
            self._bus.shutdown()

    def _drain(self) -> None:
        if not self._is_open:
            return
        receive = self._bus.recv
        frames: list[Frame] = []
        try:
            for _ in range(_DRAIN_AT_MOST):
                message = receive(0)
                if message is None:
                    break
                if message.is_error_frame:
                    self.errors.add(message.arbitration_id, message.data)
                elif not (message.is_extended_id or message.is_remote_frame):
                    data, stamp = bytes(message.data), message.timestamp
                    frames.append(Frame(message.arbitration_id, data, stamp))
        except (can.CanError, OSError) as error:
            raise _broken(self._bus.channel_info, error) from error
        finally:
            if frames:
                self._sort(frames)

    def _sort(self, frames: list[Frame]) -> None:
        """Show frames to the tap and keep those of devices."""
        if self._tap is not None:
            self._tap(frames)
        for frame in frames:
            can_id = frame.can_id
            if can_id == MODE_BROADCAST_ID:
                self.mode_hints += 1
            elif can_id & SENDER_MASK:
                self._inbox.append(frame)
            else:
                self.foreign_ids.add(can_id)
                if self.foreign_id is None:
                    self.foreign_id = can_id


_QUEUE, _RESTART_MS = 16, 100


def setup_command(channel: str, bitrate: int) -> str:
    """Return what sets a SocketCAN interface up, `bitrate` in bit/s.

    A queue of one cycle holds no stale torques, and a controller that has left the bus
    comes back by itself.
    """
    return (
        f"ip link set {channel} up txqueuelen {_QUEUE} "
        f"type can bitrate {bitrate} restart-ms {_RESTART_MS}"
    )


def _cannot_open(
    interface: str, channel: str, bitrate: int, error: Exception
) -> LinkError:
    up = f"Fix: {setup_command(channel, bitrate)}. Arm not touched."
    if interface == "socketcan" and _number_of(error) == errno.ENETDOWN:
        return LinkError(f"{channel} is down.", hint=up)
    if interface == "socketcan" and _number_of(error) == errno.ENODEV:
        return LinkError(
            f"{channel} does not exist.", hint=f"Is the adapter plugged in? {up}"
        )
    return LinkError(
        f"CAN {interface}:{channel} cannot be opened: {error}.",
        hint="Check the interface's name, its driver and its cable. Arm not touched.",
    )


def _broken(channel: str, error: Exception) -> LinkError:
    number = _number_of(error)
    is_full = number in _FULL or (number is None and "full" in str(error).lower())
    if is_full:
        return LinkFullError(
            f"CAN {channel}: the send queue is full.",
            hint="Nobody acknowledges: is the arm powered, is the bus terminated?",
        )
    return LinkError(
        f"CAN {channel} broke: {error}.",
        hint="Check the adapter and its cable, then start again.",
    )


def _number_of(error: Exception) -> int | None:
    """Return the system's error number, which python-can keeps in its own field."""
    own = getattr(error, "error_code", None)
    return own if isinstance(own, int) else getattr(error, "errno", None)


_PLAUSIBLE_NS = 10 * NS_PER_S  # a stamp further from now is of another clock


class FrameTap:
    """Implements `wam.bus.link.Tap`; times are monotonic [ns].

    A bus stamps what it receives by UTC or by the monotonic clock [s], or not at all
    (0.0); what has no stamp that can be believed is of now.
    """

    def __init__(self, tape: FrameTape, clock: Clock) -> None:
        self._tape = tape
        self._clock = clock
        self._offset_ns = utc_offset_ns(clock)[0]

    def __call__(self, frames: Sequence[tuple[int, bytes, float]]) -> None:
        """Note frames that were sent or found just now, oldest first."""
        now_ns, offset_ns = self._clock.now_ns(), self._offset_ns
        rows: list[tuple[int, int, int, bytes]] = []
        for can_id, data, stamp in frames:
            t_ns = now_ns
            if stamp:
                t_ns = round(stamp * NS_PER_S)
                if not 0 <= now_ns - t_ns < _PLAUSIBLE_NS:
                    t_ns -= offset_ns
                    if not 0 <= now_ns - t_ns < _PLAUSIBLE_NS:
                        t_ns = now_ns
            rows.append((t_ns, can_id, len(data), data))
        self._tape.add(rows)
