"""The kernel's own CAN socket: frames with the bus's time, without an object for each.

Options and layouts are Linux's (linux/can.h, linux/can/raw.h, asm-generic/socket.h);
Python's socket module has no names for most of them.
"""

import contextlib
import errno
import socket
import struct
from collections.abc import Iterable
from typing import NamedTuple

from acquisition.clock import NS_PER_S, Clock
from wam.bus.datagrams import AT_ONCE, DatagramBatch, ReceiveMany
from wam.bus.error_frames import ERROR_MASK
from wam.bus.link import DRAIN_AT_MOST, Frame, as_frame, broken_link, plausible_times

LONGEST_QUEUE = 16  # frames, about one cycle: what waits longer is stale
_RESTART_MS = 100
_FRAME = struct.Struct("=IB3x8s")  # struct can_frame
_pack = _FRAME.pack
_DATA_BYTES = 8  # at most
_ERROR_FILTER = 2  # of SOL_CAN_RAW
_TIMESTAMPING, _LOST, _MEMORY = 37, 40, 55  # of SOL_SOCKET: also SO_RXQ_OVFL, MEMINFO
_STAMPS_WANTED = 0x04 | 0x08 | 0x10 | 0x40  # of hardware and software, received
_STAMPS = struct.Struct("@qqqqqq")  # software, unused, hardware: seconds, nanoseconds
_STAMPED = struct.Struct("@Nii6q")  # nearly all ancillary data: stamps and nothing else
_SLOT = struct.Struct(f"{_STAMPED.format}{DatagramBatch.control_room - _STAMPED.size}x")
_TOTAL = struct.Struct("=I")
_MEMORY_BYTES, _WAITING_AT = 36, 8
_RECEIVE_BUFFER = 1 << 21  # bytes; the kernel grants what it may
_GET_FLAGS, _GET_QUEUE = 0x8913, 0x8942
_REQUEST = struct.Struct("@16sI20x")  # struct ifreq
_NAME_AT_MOST = 15  # characters
_UP, _RUNNING = 0x1, 0x40


class InterfaceState(NamedTuple):
    """A network interface as the kernel sees it.

    Attributes:
        is_up: somebody raised it.
        has_carrier: its controller takes part in the bus; False after bus-off.
        queue_length: how many frames it holds back at most.
    """

    is_up: bool
    has_carrier: bool
    queue_length: int


def setup_command(channel: str, bitrate: int) -> str:
    """Return what sets a SocketCAN interface up, `bitrate` in bit/s.

    A queue of one cycle holds no stale torques, and a controller that has left the bus
    comes back by itself.
    """
    return (
        f"ip link set {channel} up txqueuelen {LONGEST_QUEUE} "
        f"type can bitrate {bitrate} restart-ms {_RESTART_MS}"
    )


def interface_state(channel: str) -> InterfaceState:
    """Return the state of an interface such as "can0"; needs no rights.

    Raises:
        OSError: it does not exist.
    """
    import fcntl  # Linux has it, as it has the sockets; simulations need neither

    name = channel.encode()
    if not 0 < len(name) <= _NAME_AT_MOST or b"\0" in name:
        raise OSError(errno.ENODEV, "No such device")

    def ask(request: int) -> int:
        answer = fcntl.ioctl(any_socket, request, _REQUEST.pack(name, 0))
        return int(_REQUEST.unpack(answer)[1])

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        flags = ask(_GET_FLAGS) & 0xFFFF
        return InterfaceState(
            bool(flags & _UP), bool(flags & _RUNNING), ask(_GET_QUEUE)
        )


def open_socket(channel: str) -> socket.socket:
    """Return a raw CAN socket on an interface, error frames of all classes asked for.

    Raises:
        OSError: the kernel has no CAN, or no such interface.
    """
    opened = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    try:
        opened.setsockopt(socket.SOL_CAN_RAW, _ERROR_FILTER, ERROR_MASK)
        opened.bind((channel,))
    except OSError:
        opened.close()
        raise
    return opened


class SocketcanTransport:
    """A raw CAN socket of Linux; implements `Transport`.

    Attributes:
        name: what it is, for people.
        lost: frames that the socket had no room for.
    """

    def __init__(
        self,
        opened: socket.socket,
        channel: str,
        clock: Clock,
        receive_many: ReceiveMany,
    ) -> None:
        """Take over a bound socket; times are of `clock`.

        Args:
            opened: raw CAN socket, or one of datagrams that carries can_frames.
            channel: its interface, for messages.
            clock: which the times of frames are of.
            receive_many: recvmmsg(2), as `system_call` returns it.
        """
        self.name = "kernel socket"
        self.lost = 0
        self._socket, self._channel, self._clock = opened, channel, clock
        # Names looked up once: with cold caches each costs half a microsecond.
        self._send, self._descriptor = opened.send, opened.fileno
        self._adapter = AdapterClock()
        self._batch = DatagramBatch(_FRAME.size, receive_many)
        self._error: OSError | None = None  # it came behind frames
        opened.setblocking(False)
        for option, value in (
            (_TIMESTAMPING, _STAMPS_WANTED),
            (_LOST, 1),
            (socket.SO_RCVBUF, _RECEIVE_BUFFER),
        ):
            with contextlib.suppress(OSError):  # of an old kernel
                opened.setsockopt(socket.SOL_SOCKET, option, value)

    def fileno(self) -> int:
        """Return the socket's descriptor."""
        return self._socket.fileno()

    def has_unsent(self) -> bool:
        """Return whether frames wait to be sent; False if the kernel does not tell."""
        try:
            memory = self._socket.getsockopt(socket.SOL_SOCKET, _MEMORY, _MEMORY_BYTES)
        except OSError:  # of a kernel before 4.12, or a closed socket
            return False
        return _TOTAL.unpack_from(memory, _WAITING_AT)[0] > 0

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier; raises LinkError."""
        try:
            self._send(_pack(can_id, len(data), data))
        except OSError as error:
            raise broken_link(self._channel, error) from error

    def receive(self) -> list[Frame]:
        """Return what has arrived, oldest first; raises LinkError."""
        if self._error is not None:
            error, self._error = self._error, None
            raise broken_link(self._channel, error) from error
        frames: list[Frame] = []
        try:
            while len(frames) < DRAIN_AT_MOST and self._take(frames) == AT_ONCE:
                pass
        except OSError as error:
            if not frames:
                raise broken_link(self._channel, error) from error
            self._error = error
        return frames

    def close(self) -> None:
        """Close the socket; what is queued leaves all the same."""
        self._socket.close()

    def _take(self, frames: list[Frame]) -> int:
        """Append what one call of the kernel brings; return how many datagrams."""
        batch = self._batch
        arrived = batch.receive(self._descriptor())
        if not arrived:
            return 0
        now_ns = self._clock.now_ns()
        offset_ns = self._clock.utc_ns() - now_ns
        earliest_ns, latest_ns = plausible_times(now_ns)
        for number, (control_size, size), (can_id, length, room), stamped in zip(
            range(AT_ONCE),
            arrived,
            _FRAME.iter_unpack(batch.payload),
            _SLOT.iter_unpack(batch.control),
            strict=False,  # the memory has room for more
        ):
            if size != _FRAME.size:
                continue
            data = room if length >= _DATA_BYTES else room[:length]
            _, _, kind, seconds, rest, _, _, own_seconds, own_rest = stamped
            is_plain = kind == _TIMESTAMPING and not (own_seconds or own_rest)
            if control_size == _STAMPED.size and is_plain:
                utc_ns = seconds * NS_PER_S + rest
            else:
                utc_ns = self._utc_ns(batch.ancillary(number, control_size))
            t_ns = utc_ns - offset_ns
            if not earliest_ns < t_ns <= latest_ns:
                t_ns = 0
            frames.append(as_frame((can_id, data, t_ns)))
        return len(arrived)

    def _utc_ns(self, parts: Iterable[tuple[int, bytes]]) -> int:
        """Return when a frame was on the bus [ns], 0 = not known.

        Args:
            parts: kind and data of each part of its ancillary data.
        """
        utc_ns = 0
        for kind, data in parts:
            if kind == _TIMESTAMPING and len(data) == _STAMPS.size:
                seconds, rest, _, _, own_seconds, own_rest = _STAMPS.unpack(data)
                utc_ns = seconds * NS_PER_S + rest
                if own_seconds or own_rest:
                    self.name = "kernel socket, time of the adapter"
                    own_ns = own_seconds * NS_PER_S + own_rest
                    utc_ns = self._adapter.utc_ns(utc_ns, own_ns)
            elif kind == _LOST and len(data) == _TOTAL.size:
                self.lost = _TOTAL.unpack(data)[0]
        return utc_ns


class AdapterClock:
    """Maps an adapter's own clock to UTC by the least delay seen.

    A frame is stamped by the adapter first and by the kernel some delay later. The
    smallest difference of the two is the offset of the clocks; it is let go slowly, so
    that it follows clocks which drift apart.
    """

    _DRIFT = 1e-4  # most that two oscillators differ in rate
    _STEP_NS = 20_000_000  # a larger change is a clock that was set, or began again

    def __init__(self) -> None:
        self._offset_ns: int | None = None
        self._seen_ns = 0

    def utc_ns(self, kernel_ns: int, own_ns: int) -> int:
        """Return the adapter's time `own_ns` as UTC [ns].

        Args:
            kernel_ns: UTC at which the kernel had the frame, 0 = not known.
            own_ns: the adapter's time, of any epoch.
        """
        if not kernel_ns:
            return 0 if self._offset_ns is None else own_ns + self._offset_ns
        offset_ns = kernel_ns - own_ns
        if self._offset_ns is None or offset_ns - self._offset_ns > self._STEP_NS:
            self._offset_ns = offset_ns
        else:
            passed_ns = max(0, kernel_ns - self._seen_ns)
            released = self._offset_ns + round(passed_ns * self._DRIFT)
            self._offset_ns = min(offset_ns, released)
        self._seen_ns = kernel_ns
        return own_ns + self._offset_ns
