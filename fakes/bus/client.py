"""CAN bus on a Unix socket, client end: one 16-byte Linux `can_frame` per packet.

Any program that uses python-can can open it as interface `traction-fake` with the
socket's path as channel. The other end is fakes.bus.hub.
"""

import select
import socket
import struct

import can

from acquisition.clock import NS_PER_S, Clock, SystemClock

_FRAME = struct.Struct("=IB3x8s")
FRAME_SIZE = _FRAME.size
_FLAGS = {
    "is_extended_id": 1 << 31,
    "is_remote_frame": 1 << 30,
    "is_error_frame": 1 << 29,
}
_SEND_BUFFER = 1 << 20


def pack_frame(can_id: int, data: bytes) -> bytes:
    """Return the packet of a frame; `can_id` may include SocketCAN's flags."""
    return _FRAME.pack(can_id, len(data), data)


def unpack_frame(packet: bytes) -> tuple[int, bytes] | None:
    """Return (identifier, data) of a packet, None unless it is a classic data frame.

    Extended, remote and error frames are ignored, as by a puck.
    """
    if len(packet) != FRAME_SIZE:
        return None
    can_id, length, data = _FRAME.unpack(packet)
    if can_id > 0x7FF or length > 8:
        return None
    return can_id, data[:length]


def open_socket() -> socket.socket:
    """Return a socket of the type used by both ends."""
    made = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
    return made


class SocketBus(can.BusABC):
    """python-can client of the bus.

    Frames are stamped with UTC [s] when read. Sent frames go to the network and all
    other clients and are not echoed.

    Attributes:
        ignored: packets other than classic data frames.
    """

    def __init__(
        self,
        channel: str,
        can_filters: can.typechecking.CanFilters | None = None,
        clock: Clock | None = None,
        **_settings: object,
    ) -> None:
        """Connect to the socket at path `channel`; other settings are ignored.

        Raises:
            can.CanInitializationError: no server at this path.
        """
        self.ignored = 0
        self.channel_info = f"traction-fake:{channel}"
        self._clock = clock or SystemClock()
        self._socket = open_socket()
        try:
            self._socket.connect(str(channel))
        except OSError as error:
            self._socket.close()
            self._is_shutdown = True
            raise can.CanInitializationError(
                f"there is no server at {channel} ({error.strerror or error})",
                error.errno,
            ) from error
        self._socket.setblocking(False)
        super().__init__(channel=channel, can_filters=can_filters)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; if the buffer is full, wait `timeout` [s] at most.

        Raises:
            can.CanOperationError: the buffer stays full, or the server has ended.
            ValueError: a CAN FD frame.
        """
        if msg.is_fd:
            raise ValueError("the bus carries classic frames only")
        flags = sum(bit for name, bit in _FLAGS.items() if getattr(msg, name))
        packet = pack_frame(msg.arbitration_id | flags, bytes(msg.data or b""))
        try:
            self._send_packet(packet, timeout)
        except BlockingIOError as error:
            raise can.CanOperationError("the send buffer is full") from error
        except OSError as error:
            raise self._ended(error) from error

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 after shutdown."""
        return self._socket.fileno()

    def shutdown(self) -> None:
        """Leave the bus; a second call does nothing."""
        super().shutdown()
        self._socket.close()

    def _send_packet(self, packet: bytes, timeout: float | None) -> None:
        try:
            self._socket.send(packet)
        except BlockingIOError:
            if not timeout:
                raise
            select.select([], [self._socket], [], timeout)
            self._socket.send(packet)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            if timeout is None or timeout > 0:
                select.select([self._socket], [], [], timeout)
            frame = self._next_frame()
        except (OSError, ValueError) as error:
            raise self._ended(error) from error
        if frame is None:
            return None, False
        message = can.Message(
            timestamp=self._clock.utc_ns() / NS_PER_S,
            arbitration_id=frame[0],
            is_extended_id=False,
            data=frame[1],
            channel=self.channel_info,
            check=False,
        )
        return message, False

    def _next_frame(self) -> tuple[int, bytes] | None:
        """Return the next valid frame received, None without blocking."""
        while True:
            try:
                packet = self._socket.recv(
                    FRAME_SIZE + 1
                )  # one more shows a longer one
            except BlockingIOError:
                return None
            if not packet:
                raise OSError("the server has closed it")
            if (frame := unpack_frame(packet)) is not None:
                return frame
            self.ignored += 1

    def _ended(self, error: Exception) -> can.CanOperationError:
        return can.CanOperationError(f"{self.channel_info} has ended: {error}")
