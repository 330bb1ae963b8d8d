"""Batched socket reads: many datagrams in one system call, recvmmsg(2).

`socket.recvmsg_into` costs a system call, a list and a tuple for each frame, and an
exception for the last call. Here the kernel fills preallocated memory with the layout
of struct mmsghdr, iovec and cmsghdr of this machine's C library.
"""

import ctypes
import errno
import os
import socket
import struct
from collections.abc import Callable, Iterator

MAX_DATAGRAMS = 32  # datagrams per call
_NO_WAIT = int(socket.MSG_DONTWAIT)
_CONTROL_BYTES = 128  # ancillary data of one datagram
_HEADER = struct.Struct("@PIPNPNi0PI0P")  # struct mmsghdr
# msg_controllen and msg_len of the same struct, all else skipped
_SIZES = struct.Struct(f"@{struct.calcsize('@PIPNP')}xN4x0PI0P")
_IOVEC = struct.Struct("@PN")  # struct iovec
_CONTROL = struct.Struct("@Nii")  # struct cmsghdr
_ALIGN = struct.calcsize("@N")

ReceiveMany = Callable[[int, ctypes.c_void_p, int, int, None], int]


def system_call() -> ReceiveMany:
    """Return recvmmsg of the C library.

    Raises:
        OSError: the C library has no recvmmsg.
    """
    try:
        library = ctypes.CDLL(None, use_errno=True)
        return library.recvmmsg  # type: ignore[no-any-return]
    except (AttributeError, TypeError) as error:
        raise OSError(errno.ENOSYS, "the C library has no recvmmsg") from error


class DatagramBatch:
    """Memory for `MAX_DATAGRAMS` datagrams of up to `room` bytes, filled by one call.

    Attributes:
        payload: datagrams; datagram i starts at byte i * room.
        control: ancillary data; that of datagram i starts at byte i * control_room.
        control_room: stride of `control` [bytes].
    """

    control_room = _CONTROL_BYTES

    def __init__(self, room: int, receive_many: ReceiveMany) -> None:
        """Allocate the memory and fill in the headers.

        Args:
            room: size of a datagram [bytes]; longer ones are truncated.
            receive_many: recvmmsg(2), as `system_call` returns it.
        """
        self._call = receive_many
        self.payload = bytearray(MAX_DATAGRAMS * room)
        self.control = bytearray(MAX_DATAGRAMS * _CONTROL_BYTES)
        self._iovecs = bytearray(MAX_DATAGRAMS * _IOVEC.size)
        self._headers = bytearray(MAX_DATAGRAMS * _HEADER.size)
        payload, control, iovecs = map(
            _address, (self.payload, self.control, self._iovecs)
        )
        for i in range(MAX_DATAGRAMS):
            at = _IOVEC.size * i
            _IOVEC.pack_into(self._iovecs, at, payload + room * i, room)
            header = (0, 0, iovecs + at, 1, control + _CONTROL_BYTES * i)
            _HEADER.pack_into(
                self._headers, _HEADER.size * i, *header, _CONTROL_BYTES, 0, 0
            )
        self._initial_headers = bytes(self._headers)
        self._pointer = ctypes.c_void_p(_address(self._headers))
        self._view = memoryview(self._headers)

    def receive(self, descriptor: int) -> list[tuple[int, ...]]:
        """Read up to `MAX_DATAGRAMS` queued datagrams, oldest first, without blocking.

        Returns:
            (size of the ancillary data, size of the payload) [bytes] per datagram.

        Raises:
            OSError: the socket has an error and no datagram is queued before it.
        """
        call = self._call
        count = call(descriptor, self._pointer, MAX_DATAGRAMS, _NO_WAIT, None)
        if count <= 0:
            number = ctypes.get_errno()
            if count == 0 or number in (errno.EAGAIN, errno.EINTR):
                return []
            raise OSError(number, os.strerror(number))
        used = count * _HEADER.size
        sizes = list(_SIZES.iter_unpack(self._view[:used]))
        # The kernel overwrote the capacities with sizes.
        self._view[:used] = self._initial_headers[:used]
        return sizes

    def ancillary(self, i: int, size: int) -> Iterator[tuple[int, bytes]]:
        """Yield (type, data) of each control message of datagram i.

        Args:
            i: index of the datagram.
            size: size of its ancillary data [bytes].
        """
        at = i * _CONTROL_BYTES
        end = at + min(size, _CONTROL_BYTES)
        while at + _CONTROL.size <= end:
            length, level, kind = _CONTROL.unpack_from(self.control, at)
            if not _CONTROL.size <= length <= end - at:
                return
            if level == socket.SOL_SOCKET:
                yield kind, bytes(self.control[at + _CONTROL.size : at + length])
            at += -(-length // _ALIGN) * _ALIGN


def _address(memory: bytearray) -> int:
    return ctypes.addressof(ctypes.c_char.from_buffer(memory))
