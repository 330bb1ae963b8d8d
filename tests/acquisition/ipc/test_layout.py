from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from acquisition.devices import WrenchSample
from acquisition.ipc.layout import ProcessRole, SharedLayout
from acquisition.ipc.shared_memory import SharedMemory
from acquisition.ipc.shared_sensor import pack_wrench, unpack_wrenches
from acquisition.schema import CYCLE

finite = st.floats(allow_nan=False)
SHARED = SharedLayout.create()


def test_two_mappings_of_the_same_memory_agree():
    first = SharedLayout.create()
    second = SharedLayout(SharedMemory(first.memory.descriptor))
    payload = (bytes(range(256)) * 3)[: CYCLE.size]
    first.cycles.write(payload)
    first.status.write(b"fine")
    first.heartbeats.beat(ProcessRole.READER, 7)
    assert second.cycles.last(1).tobytes() == payload
    assert second.status.read() == b"fine"
    assert second.heartbeats.last_ns(ProcessRole.READER) == 7


def test_areas_do_not_overlap():
    shared = SharedLayout.create()
    buffers = (
        shared.commands,
        shared.cycles,
        shared.wrenches,
        shared.frames,
        shared.timings,
    )
    for number, buffer in enumerate(buffers, 1):
        size = buffer.last(0).dtype.itemsize
        for _ in range(buffer.slots):
            buffer.write(bytes([number]) * size)
    for slot in (shared.status, shared.recorder, shared.health):
        slot.write(b"\xff" * 8192)
    for number, buffer in enumerate(buffers, 1):
        records = buffer.last(buffer.slots)
        assert len(records) == buffer.slots - 1
        assert set(records.tobytes()) == {number}
    assert all(shared.heartbeats.last_ns(role) == 0 for role in ProcessRole)


@given(
    st.integers(0, 2**63),
    st.integers(0, 2**32 - 1),
    st.tuples(*[finite] * 6),
    st.integers(0, 2**16 - 1),
    st.booleans(),
    st.integers(0, 63),
)
def test_a_sample_round_trips_through_the_ring(
    t_ns, counter, wrench, status, valid, saturated
):
    sample = WrenchSample(t_ns, counter, wrench, status, valid, saturated)
    buffer = SHARED.wrenches
    buffer.write(pack_wrench(sample))
    assert unpack_wrenches(buffer.last(1)) == [sample]


def test_the_shared_memory_is_anonymous():
    descriptor = SHARED.memory.descriptor
    assert "memfd" in str(Path(f"/proc/self/fd/{descriptor}").readlink())
