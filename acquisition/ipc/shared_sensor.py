"""Wrist sensor read by another process, through shared memory."""

from typing import Final

import numpy as np

from acquisition.devices import WrenchSample
from acquisition.ipc.ring_buffer import RingBuffer
from acquisition.record_layout import struct_of
from acquisition.sample import Record

WRENCH_DTYPE = np.dtype(
    [
        ("t_ns", "<u8"),
        ("counter", "<u4"),
        ("status", "<u2"),
        ("is_valid", "?"),
        ("saturated", "u1"),
        ("wrench", "<f8", (6,)),
    ]
)
_WRENCH: Final = struct_of(WRENCH_DTYPE)


class SharedSensor:
    """Samples from shared memory; implements `acquisition.devices.WrenchSensor`."""

    def __init__(self, buffer: RingBuffer) -> None:
        self._reader = buffer.reader()

    def open(self) -> None:
        """Do nothing: the reader process has opened the port."""

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return the samples since the last call, oldest first."""
        del now_ns
        if not self._reader.backlog:
            return []
        return unpack_wrenches(self._reader.read())

    def describe(self) -> dict[str, str]:
        """Return nothing: the reader process has the description."""
        return {}

    def stream_metadata(self) -> dict[str, str]:
        """Return nothing: the reader process has the counters."""
        return {}

    def close(self) -> None:
        """Do nothing: the reader process closes the port."""


def publish(samples: list[WrenchSample], buffer: RingBuffer) -> None:
    """Write samples to a ring buffer, oldest first."""
    for sample in samples:
        buffer.write(pack_wrench(sample))


def pack_wrench(sample: WrenchSample) -> bytes:
    """Return the bytes of one sample for the ring buffer of wrenches."""
    return _WRENCH.pack(
        sample.t_ns,
        sample.counter & 0xFFFFFFFF,
        sample.status & 0xFFFF,
        sample.is_valid,
        sample.saturated,
        *sample.wrench,
    )


def unpack_wrenches(records: Record) -> list[WrenchSample]:
    """Return the samples of records of the ring buffer, oldest first."""
    return [
        WrenchSample(t_ns, counter, tuple(wrench), status, valid, saturated)
        for t_ns, counter, status, valid, saturated, *wrench in _WRENCH.iter_unpack(
            records.tobytes()
        )
    ]
