"""The board: everything that loop, recorder, sensor reader and console share.

Memory is laid out once, here, so that a process which is given the descriptor finds
everything in it. Each area has one writer.
"""

import struct
import zlib
from enum import IntEnum
from typing import Final

import numpy as np

from acquisition.devices import WrenchSample
from acquisition.errors import LinkError
from acquisition.ipc.latest_value import Slot
from acquisition.ipc.ring_buffer import Ring
from acquisition.ipc.shared_memory import LINE, SharedMemory, lines
from acquisition.sample import Record
from acquisition.schema import CYCLE, FORESIGHT

CYCLE_SLOTS = 8192  # 16 s at 500 Hz
WRENCH_SLOTS = 32_768  # 6.5 s of the fastest sensor
FRAME_SLOTS = 32_768  # 5 s of a bus with 13 frames per cycle
TIMING_SLOTS = 32_768  # 65 s of cycles
COMMAND_SLOTS = 256
FORESIGHT_SLOTS = 2048  # 20 s
_SLOT_BYTES = 8192
_MARK_BYTES = 64

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
_WRENCH: Final = struct.Struct("<QIH?B6d")
FRAME_DTYPE = np.dtype(
    [
        ("t_ns", "<u8"),
        ("can_id", "<u4"),
        ("length", "u1"),
        ("gap", "V3"),
        ("data", "V8"),
    ]
)
TIMING_DTYPE = np.dtype(
    [
        ("number", "<u8"),
        ("deadline_ns", "<u8"),
        ("woke_ns", "<u8"),
        ("replies_ns", "<u8"),
        ("sent_ns", "<u8"),
        ("ended_ns", "<u8"),
        ("is_late", "<u8"),
    ]
)
COMMAND_DTYPE = np.dtype(
    [("number", "<u8"), ("kind", "<u4"), ("argument", "<i4"), ("values", "<f8", (12,))]
)


class ProcessRole(IntEnum):
    """Who shows by its beats that it is alive."""

    CONSOLE = 0
    CONTROL = 1
    RECORDER = 2
    READER = 3


class Heartbeats:
    """When each process was last seen alive [monotonic ns], 0 = never."""

    def __init__(self, memory: memoryview) -> None:
        self._times = memory.cast("Q")

    def beat(self, role: ProcessRole, now_ns: int) -> None:
        """Note that `role` is alive now."""
        self._times[role] = now_ns

    def last_ns(self, role: ProcessRole) -> int:
        """Return when `role` was last alive, 0 = never."""
        return self._times[role]


class SharedLayout:
    """The shared memory of one rig.

    Attributes:
        memory: what it lies in.
        cycles: records of the loop (traction_msgs/Cycle).
        wrenches: every sample of the wrist sensor.
        frames: every frame of the bus.
        timings: when what happened in each cycle.
        foresight: what is foreseen (traction_msgs/Foresight).
        trial_start: where in `cycles` the running trial begins, as text; empty = none
            runs that is to be foreseen.
        commands: the console's commands to the loop.
        status: state of the loop, newest value.
        recorder: state of the recorder, newest value.
        health: newest reports of the pucks.
        heartbeats: who is alive.
    """

    def __init__(self, memory: SharedMemory) -> None:
        self.memory = memory
        self._end = 0
        self._identity = self._take(LINE)[:8].cast("Q")
        self.heartbeats = Heartbeats(self._take(lines(8 * len(ProcessRole))))
        self.status = Slot(self._take(LINE + _SLOT_BYTES))
        self.recorder = Slot(self._take(LINE + _SLOT_BYTES))
        self.health = Slot(self._take(LINE + _SLOT_BYTES))
        self.trial_start = Slot(self._take(LINE + _MARK_BYTES))
        self.commands = self._ring(COMMAND_DTYPE, COMMAND_SLOTS)
        self.cycles = self._ring(CYCLE.dtype, CYCLE_SLOTS)
        self.wrenches = self._ring(WRENCH_DTYPE, WRENCH_SLOTS)
        self.frames = self._ring(FRAME_DTYPE, FRAME_SLOTS)
        self.timings = self._ring(TIMING_DTYPE, TIMING_SLOTS)
        self.foresight = self._ring(FORESIGHT.dtype, FORESIGHT_SLOTS)

    @classmethod
    def create(cls) -> "SharedLayout":
        """Return a new, empty board."""
        layout = cls(SharedMemory.create(_SIZE))
        layout._identity[0] = _IDENTITY
        return layout

    @classmethod
    def of_process(cls, pid: int) -> "SharedLayout | None":
        """Return the board of a running process, to be read only; None for none.

        Raises:
            PermissionError: the process belongs to somebody else.
            LinkError: it runs another version of this program.
        """
        memory = SharedMemory.of_process(pid)
        if memory is None:
            return None
        identity = memory.view[:8].cast("Q")[0]
        if len(memory.view) != _SIZE or identity != _IDENTITY:
            memory.close()
            if not identity:  # it is being made
                return None
            raise LinkError(
                f"Process {pid} runs another version of this program.",
                hint="Use the version that records.",
            )
        return cls(memory)

    def close(self) -> None:
        """Give the descriptor back."""
        self.memory.close()

    def _take(self, size: int) -> memoryview:
        start, self._end = self._end, self._end + size
        return self.memory.view[start : self._end]

    def _ring(self, dtype: "np.dtype[np.void]", slots: int) -> Ring:
        return Ring(self._take(lines(Ring.size_of(dtype, slots))), dtype, slots)


_RINGS = (
    (COMMAND_DTYPE, COMMAND_SLOTS),
    (CYCLE.dtype, CYCLE_SLOTS),
    (WRENCH_DTYPE, WRENCH_SLOTS),
    (FRAME_DTYPE, FRAME_SLOTS),
    (TIMING_DTYPE, TIMING_SLOTS),
    (FORESIGHT.dtype, FORESIGHT_SLOTS),
)
_SIZE = (
    2 * LINE
    + lines(8 * len(ProcessRole))
    + 3 * (LINE + _SLOT_BYTES)
    + _MARK_BYTES
    + sum(lines(Ring.size_of(dtype, slots)) for dtype, slots in _RINGS)
)
# What tells one layout from another; it is never 0, which new memory is.
_IDENTITY = 1 + zlib.crc32(repr([(d.descr, n) for d, n in _RINGS]).encode())


def pack_wrench(sample: WrenchSample) -> bytes:
    """Return the bytes of one sample for the ring of wrenches."""
    return _WRENCH.pack(
        sample.t_ns,
        sample.counter & 0xFFFFFFFF,
        sample.status & 0xFFFF,
        sample.is_valid,
        sample.saturated,
        *sample.wrench,
    )


def unpack_wrenches(records: Record) -> list[WrenchSample]:
    """Return the samples of records of the ring of wrenches, oldest first."""
    return [
        WrenchSample(t_ns, counter, tuple(wrench), status, valid, saturated)
        for t_ns, counter, status, valid, saturated, *wrench in _WRENCH.iter_unpack(
            records.tobytes()
        )
    ]
