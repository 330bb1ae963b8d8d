"""Batched frames of a CAN socket: one system call for all waiting frames.

Every instruction of the relay is emulated, so frames are never turned into objects: the
kernel writes them to the memory shared with the host and reads them from it.
"""

import ctypes
import errno
import os
import socket

from lab.calls import FRAME, FRAMES_IN_AT, FRAMES_OUT_AT, MAX_FRAMES

_NOT_NOW = {errno.EAGAIN, errno.ENOBUFS}


class _Part(ctypes.Structure):
    """Linux's struct iovec."""

    _fields_ = [
        ("start", ctypes.c_void_p),
        ("size", ctypes.c_size_t),
    ]


class _Message(ctypes.Structure):
    """Linux's struct mmsghdr."""

    _fields_ = [
        ("name", ctypes.c_void_p),
        ("name_size", ctypes.c_uint32),
        ("parts", ctypes.POINTER(_Part)),
        ("part_count", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_size", ctypes.c_size_t),
        ("flags", ctypes.c_int),
        ("padding", ctypes.c_int),
        ("length", ctypes.c_uint),
    ]


def open_can(channel: str) -> socket.socket:
    """Return a socket on an interface such as "can1"; raises OSError."""
    opened = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    opened.bind((channel,))
    return opened


class FrameBatch:
    """A raw CAN socket whose frames are in shared memory.

    Attributes:
        lost: frames not accepted by the bus, as without an acknowledging node.
    """

    def __init__(
        self, opened: socket.socket, memory: ctypes.Array[ctypes.c_char]
    ) -> None:
        """Take over a bound CAN socket, or a datagram socket of struct can_frame."""
        self.lost = 0
        self._socket = opened
        self._memory = memory  # keeps the addresses valid
        self._arriving = _messages(ctypes.addressof(memory) + FRAMES_IN_AT)
        self._leaving = _messages(ctypes.addressof(memory) + FRAMES_OUT_AT)
        libc = ctypes.CDLL(None, use_errno=True)
        self._receive = libc.recvmmsg
        self._send = libc.sendmmsg

    def fileno(self) -> int:
        """Return the socket's descriptor."""
        return self._socket.fileno()

    def receive(self) -> int:
        """Receive the waiting frames; return their number; raises OSError."""
        count: int = self._receive(
            self.fileno(), self._arriving, MAX_FRAMES, socket.MSG_DONTWAIT, None
        )
        return self._checked(count)

    def send(self, count: int) -> None:
        """Send `count` frames; raises OSError."""
        sent: int = self._send(self.fileno(), self._leaving, count, socket.MSG_DONTWAIT)
        self.lost += count - self._checked(sent)

    def _checked(self, count: int) -> int:
        if count >= 0:
            return count
        code = ctypes.get_errno()
        if code not in _NOT_NOW:
            raise OSError(code, f"can: {os.strerror(code)}")
        return 0


def _messages(address: int) -> ctypes.Array[_Message]:
    """Return messages of one frame each, contiguous from an address."""
    messages = (_Message * MAX_FRAMES)()
    for number, message in enumerate(messages):
        part = _Part(address + number * FRAME.size, FRAME.size)
        message.parts = ctypes.pointer(part)  # which keeps the part alive
        message.part_count = 1
    return messages
