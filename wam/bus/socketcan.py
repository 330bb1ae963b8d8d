"""Raw CAN socket of Linux with timestamps, read without an object per frame.

Options and layouts are those of linux/can.h, linux/can/raw.h and asm-generic/socket.h;
Python's socket module has no names for most of them.
"""

import contextlib
import errno
import socket
import struct
from collections.abc import Iterable
from typing import NamedTuple

from acquisition.clock import NS_PER_S, Clock
from wam.bus.datagrams import MAX_DATAGRAMS, DatagramBatch, ReceiveMany
from wam.bus.error_frames import ERROR_MASK
from wam.bus.link import (
    MAX_DRAINED_FRAMES,
    Frame,
    as_frame,
    link_error,
    plausible_times,
)

LONGEST_QUEUE = 16  # frames, about one cycle: torques that wait longer are stale
_RESTART_MS = 100
_FRAME = struct.Struct("=IB3x8s")  # struct can_frame
_pack = _FRAME.pack
_DATA_BYTES = 8
_ERROR_FILTER = 2  # of SOL_CAN_RAW
_TIMESTAMPING, _LOST, _MEMORY = 37, 40, 55  # of SOL_SOCKET: also SO_RXQ_OVFL, MEMINFO
_STAMPS_WANTED = 0x04 | 0x08 | 0x10 | 0x40  # RX hardware, RX software, report both
_STAMPS = struct.Struct("@qqqqqq")  # software, unused, hardware: seconds, nanoseconds
_STAMPED = struct.Struct("@Nii6q")  # the usual ancillary data: one message of stamps
_SLOT = struct.Struct(f"{_STAMPED.format}{DatagramBatch.control_room - _STAMPED.size}x")
_TOTAL = struct.Struct("=I")
_MEMORY_BYTES, _WAITING_AT = 36, 8  # size of SO_MEMINFO, offset of wmem_alloc
_RECEIVE_BUFFER = 1 << 21  # bytes; the kernel clips it to its limit
_GET_FLAGS, _GET_QUEUE = 0x8913, 0x8942  # SIOCGIFFLAGS, SIOCGIFTXQLEN
_REQUEST = struct.Struct("@16sI20x")  # struct ifreq
_LONGEST_NAME = 15  # characters
_UP, _RUNNING = 0x1, 0x40


class InterfaceState(NamedTuple):
    """State of a network interface.

    Attributes:
        is_up: the interface is set up.
        has_carrier: the controller takes part in the bus; False after bus-off.
        queue_length: capacity of the send queue [frames].
    """

    is_up: bool
    has_carrier: bool
    queue_length: int


def setup_command(channel: str, bitrate: int) -> str:
    """Return the shell command that sets up a SocketCAN interface, `bitrate` [bit/s].

    The send queue holds one cycle, so that no stale torques are sent, and the
    controller restarts by itself after bus-off.
    """
    return (
        f"ip link set {channel} up txqueuelen {LONGEST_QUEUE} "
        f"type can bitrate {bitrate} restart-ms {_RESTART_MS}"
    )


def interface_state(channel: str) -> InterfaceState:
    """Return the state of an interface such as "can0"; needs no privileges.

    Raises:
        OSError: the interface does not exist.
    """
    import fcntl  # not on every platform that can simulate

    name = channel.encode()
    if not 0 < len(name) <= _LONGEST_NAME or b"\0" in name:
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
    """Return a raw CAN socket bound to an interface, with all error frames enabled.

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
        name: name for people.
        lost: frames dropped because the receive buffer was full.
    """

    def __init__(
        self,
        opened: socket.socket,
        channel: str,
        clock: Clock,
        receive_many: ReceiveMany,
    ) -> None:
        """Take ownership of a bound socket.

        Args:
            opened: raw CAN socket, or a datagram socket that carries can_frames.
            channel: name of its interface, for messages.
            clock: time base of the frames' times.
            receive_many: recvmmsg(2), as `system_call` returns it.
        """
        self.name = "kernel socket"
        self.lost = 0
        self._socket, self._channel, self._clock = opened, channel, clock
        # Bound once: an attribute lookup with cold caches costs half a microsecond.
        self._send, self._descriptor = opened.send, opened.fileno
        self._adapter = AdapterClock()
        self._batch = DatagramBatch(_FRAME.size, receive_many)
        self._error: OSError | None = None  # raised after the frames before it
        opened.setblocking(False)
        for option, value in (
            (_TIMESTAMPING, _STAMPS_WANTED),
            (_LOST, 1),
            (socket.SO_RCVBUF, _RECEIVE_BUFFER),
        ):
            with contextlib.suppress(OSError):  # an old kernel lacks the option
                opened.setsockopt(socket.SOL_SOCKET, option, value)

    def fileno(self) -> int:
        """Return the socket's descriptor."""
        return self._socket.fileno()

    def has_unsent(self) -> bool:
        """Return whether frames wait in the send queue; False if it is not known."""
        try:
            memory = self._socket.getsockopt(socket.SOL_SOCKET, _MEMORY, _MEMORY_BYTES)
        except OSError:  # kernel before 4.12, or closed socket
            return False
        return _TOTAL.unpack_from(memory, _WAITING_AT)[0] > 0

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier; raises LinkError."""
        try:
            self._send(_pack(can_id, len(data), data))
        except OSError as error:
            raise link_error(self._channel, error) from error

    def receive(self) -> list[Frame]:
        """Return the queued frames, oldest first; raises LinkError."""
        if self._error is not None:
            error, self._error = self._error, None
            raise link_error(self._channel, error) from error
        frames: list[Frame] = []
        try:
            while (
                len(frames) < MAX_DRAINED_FRAMES and self._take(frames) == MAX_DATAGRAMS
            ):
                pass
        except OSError as error:
            if not frames:
                raise link_error(self._channel, error) from error
            self._error = error
        return frames

    def close(self) -> None:
        """Close the socket; queued frames are still sent."""
        self._socket.close()

    def _take(self, frames: list[Frame]) -> int:
        """Append the frames of one system call; return the number of datagrams."""
        batch = self._batch
        arrived = batch.receive(self._descriptor())
        if not arrived:
            return 0
        now_ns = self._clock.now_ns()
        offset_ns = self._clock.utc_ns() - now_ns
        earliest_ns, latest_ns = plausible_times(now_ns)
        for number, (control_size, size), (can_id, length, room), stamped in zip(
            range(MAX_DATAGRAMS),
            arrived,
            _FRAME.iter_unpack(batch.payload),
            _SLOT.iter_unpack(batch.control),
            strict=False,  # the batch may be filled in part
        ):
            if size != _FRAME.size:
                continue
            data = room if length >= _DATA_BYTES else room[:length]
            _, _, kind, seconds, nanoseconds, _, _, own_seconds, own_rest = stamped
            is_plain = kind == _TIMESTAMPING and not (own_seconds or own_rest)
            if control_size == _STAMPED.size and is_plain:
                utc_ns = seconds * NS_PER_S + nanoseconds
            else:
                utc_ns = self._utc_ns(batch.ancillary(number, control_size))
            t_ns = utc_ns - offset_ns
            if not earliest_ns < t_ns <= latest_ns:
                t_ns = 0
            frames.append(as_frame((can_id, data, t_ns)))
        return len(arrived)

    def _utc_ns(self, parts: Iterable[tuple[int, bytes]]) -> int:
        """Return the bus time of a frame by its control messages [UTC ns], 0 = unknown.

        Args:
            parts: (type, data) of each control message.
        """
        utc_ns = 0
        for kind, data in parts:
            if kind == _TIMESTAMPING and len(data) == _STAMPS.size:
                seconds, nanoseconds, _, _, own_seconds, own_rest = _STAMPS.unpack(data)
                utc_ns = seconds * NS_PER_S + nanoseconds
                if own_seconds or own_rest:
                    self.name = "kernel socket, time of the adapter"
                    own_ns = own_seconds * NS_PER_S + own_rest
                    utc_ns = self._adapter.utc_ns(utc_ns, own_ns)
            elif kind == _LOST and len(data) == _TOTAL.size:
                self.lost = _TOTAL.unpack(data)[0]
        return utc_ns


class AdapterClock:
    """Maps an adapter's clock to UTC by the minimum observed delay.

    The adapter stamps a frame first, the kernel after some delay. The smallest
    difference of the two is the clock offset; it is relaxed slowly, to follow clock
    drift.
    """

    _DRIFT = 1e-4  # largest rate difference of two oscillators
    _STEP_NS = 20_000_000  # a larger change: a clock was set or restarted

    def __init__(self) -> None:
        self._offset_ns: int | None = None
        self._seen_ns = 0

    def utc_ns(self, kernel_ns: int, own_ns: int) -> int:
        """Return the adapter's time `own_ns` as UTC [ns].

        Args:
            kernel_ns: kernel timestamp of the frame [UTC ns], 0 = not known.
            own_ns: adapter's timestamp [ns] since any epoch.
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
