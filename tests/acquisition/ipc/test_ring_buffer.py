import numpy as np
import pytest

from acquisition.ipc.ring_buffer import RingBuffer
from acquisition.schema import CYCLE
from tests.acquisition.trials import make_cycles


def write(buffer, cycles):
    data = memoryview(cycles.tobytes())
    for i in range(len(cycles)):
        buffer.write(data[i * CYCLE.size : (i + 1) * CYCLE.size])


@pytest.fixture
def buffer():
    size = RingBuffer.size_of(CYCLE.dtype, 17)
    return RingBuffer(memoryview(bytearray(size)), CYCLE.dtype, 17)


def numbers(records):
    return records["cycle"].tolist()


def test_a_reader_gets_every_record_once_and_in_order(buffer):
    reader = buffer.reader()
    cycles = make_cycles(30, first=0)
    write(buffer, cycles[:10])
    first = reader.read()
    write(buffer, cycles[10:24])
    assert numbers(first) + numbers(reader.read()) == list(range(24))
    assert len(reader.read()) == 0
    assert reader.lost == 0


def test_records_round_trip_bit_for_bit(buffer):
    reader = buffer.reader()
    cycles = make_cycles(12)
    write(buffer, cycles)
    assert reader.read().tobytes() == cycles.tobytes()


def test_a_lapped_reader_learns_how_many_it_lost(buffer):
    reader = buffer.reader()
    write(buffer, make_cycles(21, first=0))
    assert numbers(reader.read()) == list(range(5, 21))
    assert reader.lost == 5


def test_losses_add_up(buffer):
    reader = buffer.reader()
    for _ in range(3):
        write(buffer, make_cycles(18, first=0))
        reader.read()
    assert reader.lost == 6


def test_a_full_ring_loses_nothing(buffer):
    reader = buffer.reader()
    write(buffer, make_cycles(16, first=0))
    assert numbers(reader.read()) == list(range(16))
    assert reader.lost == 0


def test_a_reader_begins_at_the_next_record(buffer):
    write(buffer, make_cycles(5, first=0))
    reader = buffer.reader()
    write(buffer, make_cycles(2, first=5))
    assert numbers(reader.read()) == [5, 6]


def test_rewinding_brings_back_what_was_read(buffer):
    reader = buffer.reader()
    write(buffer, make_cycles(10, first=0))
    reader.read()
    reader.rewind(4)
    assert numbers(reader.read()) == [6, 7, 8, 9]


@pytest.mark.parametrize("written", [3, 10, 40])
def test_rewinding_too_far_goes_to_the_oldest_and_loses_nothing(buffer, written):
    reader = buffer.reader()
    write(buffer, make_cycles(written, first=0))
    reader.read()
    reader.lost = 0
    reader.rewind(500)
    assert numbers(reader.read()) == list(range(max(0, written - 16), written))
    assert reader.lost == 0


def test_the_latest_record_is_the_newest(buffer):
    assert len(buffer.last(1)) == 0
    write(buffer, make_cycles(20, first=0))
    assert numbers(buffer.last(1)) == [19]


def test_records_read_do_not_change_afterwards(buffer):
    reader = buffer.reader()
    write(buffer, make_cycles(16, first=0))
    records = reader.read()
    write(buffer, make_cycles(16, first=100))
    assert numbers(records) == list(range(16))


def test_a_copy_holds_no_stray_memory(buffer):
    write(buffer, np.frombuffer(bytearray(CYCLE.template), CYCLE.dtype))
    assert buffer.last(1).copy().tobytes() == CYCLE.template
