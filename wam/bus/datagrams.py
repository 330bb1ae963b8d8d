"""Many datagrams of a socket by one call of the kernel, recvmmsg(2).

A frame by `socket.recvmsg_into` costs a call of the kernel, a list and a tuple, and the
last call an exception. Here the kernel fills memory that was laid out once: layouts are
those of struct mmsghdr, iovec and cmsghdr, as the C library of this machine has them.
"""

import ctypes
import errno
import os
import socket
import struct
from collections.abc import Callable, Iterator

AT_ONCE = 32  # datagrams of one call
_NO_WAIT = int(socket.MSG_DONTWAIT)
_CONTROL_BYTES = 128  # ancillary data of one datagram
_HEADER = struct.Struct("@PIPNPNi0PI0P")  # struct mmsghdr
_SIZES = struct.Struct(f"@{struct.calcsize('@PIPNP')}xN4x0PI0P")  # what is read of it
_IOVEC = struct.Struct("@PN")  # struct iovec
_CONTROL = struct.Struct("@Nii")  # struct cmsghdr
_ALIGN = struct.calcsize("@N")

ReceiveMany = Callable[[int, ctypes.c_void_p, int, int, None], int]


def system_call() -> ReceiveMany:
    """Return recvmmsg of the C library.

    Raises:
        OSError: it has none.
    """
    try:
        library = ctypes.CDLL(None, use_errno=True)
        return library.recvmmsg  # type: ignore[no-any-return]
    except (AttributeError, TypeError) as error:
        raise OSError(errno.ENOSYS, "the C library has no recvmmsg") from error


class DatagramBatch:
    """Memory for `AT_ONCE` datagrams of up to `room` bytes, filled by one call.

    Attributes:
        payload: datagram i from byte i * room on.
        control: its ancillary data from byte i * control_room on.
        control_room: bytes from one to the next.
    """

    control_room = _CONTROL_BYTES

    def __init__(self, room: int, receive_many: ReceiveMany) -> None:
        """Lay the memory out.

        Args:
            room: bytes of a datagram; what is longer is cut.
            receive_many: recvmmsg(2), as `system_call` returns it.
        """
        self._call = receive_many
        self.payload = bytearray(AT_ONCE * room)
        self.control = bytearray(AT_ONCE * _CONTROL_BYTES)
        self._iovecs = bytearray(AT_ONCE * _IOVEC.size)
        self._headers = bytearray(AT_ONCE * _HEADER.size)
        payload, control, iovecs = map(
            _address, (self.payload, self.control, self._iovecs)
        )
        for i in range(AT_ONCE):
            at = _IOVEC.size * i
            _IOVEC.pack_into(self._iovecs, at, payload + room * i, room)
            header = (0, 0, iovecs + at, 1, control + _CONTROL_BYTES * i)
            _HEADER.pack_into(
                self._headers, _HEADER.size * i, *header, _CONTROL_BYTES, 0, 0
            )
        self._fresh = bytes(self._headers)
        self._pointer = ctypes.c_void_p(_address(self._headers))
        self._view = memoryview(self._headers)

    def receive(self, descriptor: int) -> list[tuple[int, ...]]:
        """Take what waits on a socket, at most `AT_ONCE`, oldest first; never waits.

        Returns:
            bytes of its ancillary data and bytes of itself, for each datagram.

        Raises:
            OSError: the socket has an error and nothing came before it.
        """
        call = self._call
        count = call(descriptor, self._pointer, AT_ONCE, _NO_WAIT, None)
        if count <= 0:
            number = ctypes.get_errno()
            if count == 0 or number in (errno.EAGAIN, errno.EINTR):
                return []
            raise OSError(number, os.strerror(number))
        used = count * _HEADER.size
        sizes = list(_SIZES.iter_unpack(self._view[:used]))
        self._view[:used] = self._fresh[:used]  # the kernel wrote its sizes there
        return sizes

    def ancillary(self, i: int, size: int) -> Iterator[tuple[int, bytes]]:
        """Yield kind and data of each part of datagram i's ancillary data.

        Args:
            i: number of the datagram.
            size: bytes of its ancillary data.
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
