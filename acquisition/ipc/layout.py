"""Layout of the shared memory of loop, recorder, sensor reader and console.

The layout is fixed, so that a process needs only the descriptor. Each area has one
writer.
"""

import zlib
from collections.abc import Mapping
from enum import IntEnum
from itertools import accumulate, pairwise

from acquisition.control_loop.timing import TIMING_DTYPE
from acquisition.errors import LinkError
from acquisition.ipc.commands import COMMAND_DTYPE
from acquisition.ipc.frame_ring import FRAME_DTYPE
from acquisition.ipc.latest_value import Slot
from acquisition.ipc.ring_buffer import LayoutType, RingBuffer
from acquisition.ipc.shared_memory import LINE, SharedMemory, lines
from acquisition.ipc.shared_sensor import WRENCH_DTYPE
from acquisition.schema import CYCLE

WRENCH_SLOTS = 32_768  # 6.5 s of the fastest sensor


class ProcessRole(IntEnum):
    """Process with a heartbeat."""

    CONSOLE = 0
    CONTROL = 1
    RECORDER = 2
    READER = 3


class Heartbeats:
    """Time of each process's last heartbeat [monotonic ns], 0 = never."""

    def __init__(self, memory: memoryview) -> None:
        self._times = memory.cast("Q")

    def beat(self, role: ProcessRole, now_ns: int) -> None:
        """Set the heartbeat of `role`."""
        self._times[role] = now_ns

    def last_ns(self, role: ProcessRole) -> int:
        """Return the last heartbeat of `role` [monotonic ns], 0 = never."""
        return self._times[role]


_SLOTS: Mapping[str, int] = {  # largest value of each [bytes]
    "status": 8192,
    "recorder": 8192,
    "health": 8192,
}
_BUFFERS: Mapping[str, tuple[LayoutType, int]] = {  # type and number of records
    "commands": (COMMAND_DTYPE, 256),
    "cycles": (CYCLE.dtype, 8192),  # 16 s at 500 Hz
    "wrenches": (WRENCH_DTYPE, WRENCH_SLOTS),
    "frames": (FRAME_DTYPE, 32_768),  # 5 s of a bus with 13 frames per cycle
    "timings": (TIMING_DTYPE, 32_768),  # 65 s of cycles
}
_AREAS: Mapping[str, int] = {  # in the order of the memory [bytes]
    "identity": LINE,
    "heartbeats": lines(8 * len(ProcessRole)),
    **{name: LINE + most for name, most in _SLOTS.items()},
    **{name: lines(RingBuffer.size_of(*spec)) for name, spec in _BUFFERS.items()},
}
_SIZE = sum(_AREAS.values())
# Checksum of the layout; never 0, which is the content of new memory.
_IDENTITY = 1 + zlib.crc32(repr([(d.descr, n) for d, n in _BUFFERS.values()]).encode())


class SharedLayout:
    """Shared memory of one rig.

    Attributes:
        memory: underlying memory.
        cycles: records of the loop (traction_msgs/Cycle).
        wrenches: samples of the wrist sensor.
        frames: frames of the bus.
        timings: timing records of the cycles.
        commands: commands of the console to the loop.
        status: status of the loop, latest value.
        recorder: status of the recorder, latest value.
        health: metadata of the devices, latest value.
        heartbeats: heartbeats of the processes.
    """

    def __init__(self, memory: SharedMemory) -> None:
        self.memory = memory
        ends = list(accumulate(_AREAS.values(), initial=0))
        areas = {
            name: memory.view[start:end]
            for name, (start, end) in zip(_AREAS, pairwise(ends), strict=True)
        }
        self._identity = areas["identity"][:8].cast("Q")
        self.heartbeats = Heartbeats(areas["heartbeats"])
        self.status = Slot(areas["status"])
        self.recorder = Slot(areas["recorder"])
        self.health = Slot(areas["health"])
        self.commands = RingBuffer(areas["commands"], *_BUFFERS["commands"])
        self.cycles = RingBuffer(areas["cycles"], *_BUFFERS["cycles"])
        self.wrenches = RingBuffer(areas["wrenches"], *_BUFFERS["wrenches"])
        self.frames = RingBuffer(areas["frames"], *_BUFFERS["frames"])
        self.timings = RingBuffer(areas["timings"], *_BUFFERS["timings"])

    @classmethod
    def create(cls) -> "SharedLayout":
        """Return new, empty memory."""
        layout = cls(SharedMemory.create(_SIZE))
        layout._identity[0] = _IDENTITY
        return layout

    @classmethod
    def of_process(cls, pid: int) -> "SharedLayout | None":
        """Return the memory of a running process, read-only; None if it has none.

        Raises:
            PermissionError: the process belongs to another user.
            LinkError: the process runs another version of this program.
        """
        memory = SharedMemory.of_process(pid)
        if memory is None:
            return None
        identity = memory.view[:8].cast("Q")[0]
        if len(memory.view) != _SIZE or identity != _IDENTITY:
            memory.close()
            if not identity:  # being created
                return None
            raise LinkError(
                f"Process {pid} runs another version of this program.",
                hint="Use the version that records.",
            )
        return cls(memory)

    def close(self) -> None:
        """Close the descriptor."""
        self.memory.close()
