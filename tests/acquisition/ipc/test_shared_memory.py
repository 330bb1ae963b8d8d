from pathlib import Path

from acquisition.ipc.heap import trim_heap
from acquisition.ipc.shared_memory import SharedMemory

MB = 1_000_000


def resident():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096


def test_memory_of_deleted_objects_is_returned_to_the_kernel():
    blocks = [bytes(1000) for _ in range(40_000)]
    blocks, pins = [], blocks[::40]  # the remaining blocks keep the heap from shrinking
    held = resident()
    trim_heap()
    assert held - resident() > 20 * MB
    assert len(pins) == 1000
    assert not blocks


def test_shared_memory_begins_as_zeros_and_is_written_through():
    memory = SharedMemory.create(8192)
    assert not any(memory.view)
    memory.view[100] = 7
    memory.touch()
    assert memory.view[100] == 7
    memory.close()
    memory.close()
    assert memory.descriptor == -1
