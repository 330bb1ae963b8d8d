import pytest

from acquisition.ipc.latest_value import Slot
from acquisition.ipc.shared_memory import LINE


@pytest.fixture
def memory():
    return memoryview(bytearray(LINE + 100))


def test_a_slot_gives_its_newest_value_to_every_mapping(memory):
    writer, reader = Slot(memory), Slot(memory)
    writer.write(b"old and long")
    writer.write(b"new")
    assert reader.read() == b"new"


def test_a_slot_is_empty_before_its_first_value(memory):
    assert Slot(memory).read() == b""


def test_every_value_has_its_own_version(memory):
    slot = Slot(memory)
    versions = set()
    for value in (b"a", b"a", b"b"):
        slot.write(value)
        versions.add(slot.version)
    assert len(versions) == 3


def test_a_value_that_is_being_written_is_not_read(memory):
    slot = Slot(memory)
    slot.write(b"whole")
    memory[:8].cast("Q")[0] += 1  # a writer that was stopped in the middle
    assert slot.read() == b""


def test_an_oversized_value_is_refused_and_the_old_one_kept(memory):
    slot = Slot(memory)
    slot.write(b"x" * 100)
    with pytest.raises(ValueError, match="101 bytes"):
        slot.write(b"y" * 101)
    assert slot.read() == b"x" * 100
