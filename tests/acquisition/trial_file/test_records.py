"""The scanner of MCAP records: lengths are checked before anything is read."""

import io
import struct
import tracemalloc

import pytest
from mcap.opcode import Opcode
from mcap.records import Metadata
from mcap.writer import Writer

from acquisition.trial_file.records import (
    MAGIC,
    parse,
    record_at,
    records_in,
    records_of,
)
from acquisition.trial_file.unpacking import DamageError

MIB = 2**20
END = struct.pack("<BQI", Opcode.DATA_END, 4, 0)


def record(opcode, body, length=None):
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def scanned(folder, data, largest=MIB):
    """Return the records of `data` up to the first damaged one, and the damage."""
    path = folder / "log.mcap"
    path.write_bytes(MAGIC + data)
    found = []
    with path.open("rb") as file:
        file.read(len(MAGIC))
        try:
            for raw in records_in(file, largest):
                found.append((raw.opcode, bytes(raw.body), raw.end))
        except DamageError as error:
            return found, str(error)
    return found, ""


def test_records_of_a_file_and_of_a_buffer_are_the_same(tmp_path):
    data = record(5, b"one") + record(99, b"") + record(7, bytes(300))
    found, damage = scanned(tmp_path, data + END)
    same = [
        (raw.opcode, bytes(raw.body), raw.end + len(MAGIC))
        for raw in records_of(memoryview(data))
    ]
    assert (found, damage) == (same, "")
    assert found[-1][2] == len(MAGIC) + len(data)


@pytest.mark.parametrize(
    ("tail", "reason"),
    [
        (record(5, b"abc", 4), "the file is cut there"),
        (record(5, b"abc", MIB), "the file is cut there"),
        (record(5, b"abc", MIB + 1), f"a record of {MIB + 1} bytes"),
        (record(5, b"abc", 2**64 - 1), f"a record of {2**64 - 1} bytes"),
        (b"\x05\x01", "the file ends without its end mark"),
        (b"", "the file ends without its end mark"),
    ],
)
def test_reading_ends_at_damage_after_the_sound_records(tmp_path, tail, reason):
    first = record(5, b"one")
    found, damage = scanned(tmp_path, first + tail)
    assert found == [(5, b"one", len(MAGIC) + len(first))]
    assert damage == reason


def test_a_length_beyond_the_file_allocates_no_memory(tmp_path):
    tracemalloc.start()
    try:
        scanned(tmp_path, record(5, b"abc", 900 * MIB), largest=1024 * MIB)
        assert tracemalloc.get_traced_memory()[1] < MIB
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("length", [4, 2**40, 2**64 - 1])
def test_a_record_beyond_its_buffer_is_not_a_record(length):
    data = memoryview(record(5, b"abc") + record(5, b"abc", length))
    assert record_at(data, 0) is not None
    assert record_at(data, 12) is None
    with pytest.raises(DamageError, match="a chunk that ends in a record"):
        list(records_of(data, what="a chunk"))


@pytest.mark.parametrize("offset", [24, 25, 2**63, 2**64 - 1])
def test_there_is_no_record_after_the_end(offset):
    data = memoryview(record(5, b"abc") * 2)
    assert record_at(data, offset) is None
    assert record_at(data, 23) is None  # a head that is cut


def metadata_body(values):
    """Return the body of metadata as the mcap library writes it."""
    out = io.BytesIO()
    writer = Writer(out)
    writer.start()
    at = out.tell()
    writer.add_metadata("name", values)
    return out.getvalue()[at + 9 :]


def test_metadata_round_trip():
    values = {"a": "1", "": "", "ü": "µ" * 300}
    body = memoryview(metadata_body(values))
    assert parse(Metadata, body) == Metadata(name="name", metadata=values)


@pytest.mark.parametrize("at", [0, 8, 12])
def test_metadata_with_wrong_lengths_are_damaged(at):
    body = bytearray(metadata_body({"key": "value"}))
    for length in (1, 6, 200, 2**32 - 1):
        struct.pack_into("<I", body, at, length)
        with pytest.raises((DamageError, struct.error)):
            parse(Metadata, memoryview(body))
