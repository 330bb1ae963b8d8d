"""The one door to python-can: a bus that is only drained, and questions over it."""

import errno
from typing import NamedTuple, Protocol

import can

from acquisition.clock import Clock
from acquisition.errors import LinkError, LinkTimeoutError
from wam.frames import (
    HOST,
    SAFETY_NODE,
    SENDER_MASK,
    FrameError,
    Group,
    Payload,
    compose_id,
    decode_reply,
    encode_get,
    encode_set,
    group_id,
    property_reply_id,
)

MODE_BROADCAST_ID = compose_id(SAFETY_NODE, Group.BUS, is_group=True)
_ANSWER_NS = 50_000_000  # a puck answers within 1 ms; a slow adapter may sit on it
_DRAIN_AT_MOST = 512  # frames; no flood may keep the loop here


class Frame(NamedTuple):
    """A frame as received.

    Attributes:
        can_id: 11-bit identifier.
        data: payload.
        stamp: time of arrival by the bus's own clock [s], 0.0 = the bus has none.
    """

    can_id: int
    data: Payload
    stamp: float


class Link(Protocol):
    """Frames out, frames in; what a driver needs of a bus."""

    mode_hints: int

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
    content: it is counted in `mode_hints` and dropped.

    Attributes:
        mode_hints: broadcasts of the safety module so far.
        error_frames: error frames of the controller so far.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self.mode_hints = 0
        self.error_frames = 0
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
        message = can.Message(arbitration_id=can_id, is_extended_id=False, data=data)
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            raise _broken(self._bus.channel_info, error) from error

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
        try:
            for _ in range(_DRAIN_AT_MOST):
                message = receive(0)
                if message is None:
                    return
                self._sort(message)
        except (can.CanError, OSError) as error:
            raise _broken(self._bus.channel_info, error) from error

    def _sort(self, message: can.Message) -> None:
        can_id = message.arbitration_id
        if message.is_error_frame:
            self.error_frames += 1
        elif can_id == MODE_BROADCAST_ID:
            self.mode_hints += 1
        elif not (message.is_extended_id or message.is_remote_frame) and (
            can_id & SENDER_MASK
        ):
            self._inbox.append(Frame(can_id, message.data, message.timestamp))


class Dialogue:
    """Questions to devices outside the loop, one at a time.

    Replies carry no sequence number, so each is matched by device and property, and
    what came too late for an earlier question is drained first.

    Attributes:
        late_replies: frames that answered no open question, so far.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self.late_replies = 0
        self._link = link
        self._clock = clock

    def ask(self, node: int, number: int, within_ns: int = _ANSWER_NS) -> int | None:
        """Return the value of property `number` of `node`, None if it is silent.

        Raises:
            LinkError: the bus is down.
        """
        self.drain()
        deadline_ns = self._clock.now_ns() + within_ns
        self._link.send(node, encode_get(number))
        while self._clock.wait(self._link, deadline_ns):
            value = self._find(property_reply_id(node), number)
            if value is not None:
                return value
            if self._clock.now_ns() >= deadline_ns:
                break
        return None

    def require(self, node: int, number: int, name: str) -> int:
        """Return the value of a property that must be there.

        Raises:
            LinkTimeoutError: the device does not answer.
            LinkError: the bus is down.
        """
        value = self.ask(node, number)
        if value is None:
            raise LinkTimeoutError(
                f"Node {node} does not answer GET {name} ({number}) within "
                f"{_ANSWER_NS // 1_000_000} ms.",
                hint="Check its cable, the arm's power and the terminators.",
            )
        return value

    def tell(self, node: int, number: int, value: int) -> None:
        """Set a property of one device; devices do not acknowledge."""
        self._link.send(node, encode_set(number, value))

    def tell_group(self, group: Group, number: int, value: int) -> None:
        """Set a property of all devices of a group."""
        self._link.send(group_id(group, HOST), encode_set(number, value))

    def drain(self) -> None:
        """Throw away what nobody asked for."""
        self.late_replies += len(self._link.receive())

    def pause(self, duration_ns: int) -> None:
        """Say nothing for a while."""
        self._clock.sleep_until(self._clock.now_ns() + duration_ns)

    def _find(self, can_id: int, number: int) -> int | None:
        found: int | None = None
        for frame in self._link.receive():
            value = _value_of(frame, can_id, number) if found is None else None
            if value is None:
                self.late_replies += 1
            else:
                found = value
        return found


def _value_of(frame: Frame, can_id: int, number: int) -> int | None:
    if frame.can_id != can_id:
        return None
    try:
        reply = decode_reply(frame.data)
    except FrameError:
        return None
    return reply.value if reply.number == number else None


def _cannot_open(
    interface: str, channel: str, bitrate: int, error: Exception
) -> LinkError:
    up = f"Fix: ip link set {channel} up type can bitrate {bitrate}. Arm not touched."
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
    if _number_of(error) in (errno.ENOBUFS, None) and "full" in str(error).lower():
        return LinkError(
            f"CAN {channel}: the send buffer is full.",
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
