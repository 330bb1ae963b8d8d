"""Damaged and hostile files are read correctly or refused with an error naming them."""

import os
import struct
import zlib

import numpy as np
import pytest
import zstandard

from acquisition.errors import TrialFileError
from acquisition.recording.recorder import seal
from acquisition.schema import CYCLE, schema_text
from acquisition.trial_file.contents import RECORD_LIMIT
from acquisition.trial_file.data_files import size_limit
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.verify import verify_file
from tests.acquisition.forged import (
    PACKERS,
    chunk_content,
    foreign,
    one_message,
    packed_trial,
    with_chunk,
)
from tests.acquisition.ros import messages_of
from tests.acquisition.trials import (
    flipped,
    make_cycles,
    resealed,
    span_of,
    spans,
    summary_start,
    write_trial,
)

CHUNK, INDEX, ATTACHMENT, CHUNK_INDEX, STATISTICS, METADATA = 6, 7, 9, 8, 11, 12
GIB = 2**30


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    """Return the bytes of a good trial and the records in it."""
    path = tmp_path_factory.mktemp("good") / "T01.mcap"
    seal(write_trial(path, make_cycles(300), block=50), "travel")
    return path.read_bytes(), TrialReader(path).cycles().data


@pytest.fixture
def put(tmp_path):
    def put(data):
        path = tmp_path / "T.mcap"
        path.write_bytes(data)
        return path

    return put


def everything(path):
    """Return all cycles, metadata and attachments."""
    reader = TrialReader(path)
    return reader.cycles().data, reader.metadata, reader.attachments


def patched(data, at, form, value):
    data = bytearray(data)
    struct.pack_into(form, data, at, value)
    return bytes(data)


@pytest.mark.parametrize(
    "content",
    [b"", b"\x89", b"hello, this is a text file\n" * 9, b"\x89MCAP0\r\n", bytes(999)],
    ids=["empty", "byte", "text", "magic", "zeros"],
)
def test_a_foreign_file_is_not_a_trial(put, content):
    with pytest.raises(TrialFileError, match="no MCAP file"):
        TrialReader(put(content))


def test_two_magics_alone_are_not_a_trial(put):
    with pytest.raises(TrialFileError):
        TrialReader(put(b"\x89MCAP0\r\n" * 2))


def test_a_missing_file_is_reported(tmp_path):
    with pytest.raises(TrialFileError, match=r"T99\.mcap"):
        TrialReader(tmp_path / "T99.mcap")


def test_a_folder_is_not_a_trial(tmp_path):
    with pytest.raises(TrialFileError):
        TrialReader(tmp_path)


def test_another_profile_is_reported(put):
    with pytest.raises(TrialFileError, match="profile 'ros1'"):
        TrialReader(put(foreign("ros1")))


def test_another_ros_recording_is_not_a_trial(put):
    with pytest.raises(TrialFileError, match="no trial of Traction"):
        TrialReader(put(foreign("ros2", "route")))


def test_a_file_without_checksums_is_refused(put):
    with pytest.raises(TrialFileError, match="data without a checksum"):
        TrialReader(put(foreign("ros2", data_crcs=False)))


def test_a_trial_without_cycles_is_reported_as_such(put):
    with pytest.raises(TrialFileError, match="no topic /cycle"):
        TrialReader(put(foreign("ros2"))).cycles()


@pytest.mark.parametrize("share", np.linspace(0.0, 0.9999, 10))
def test_a_truncated_file_is_refused(put, pristine, share):
    data = pristine[0]
    with pytest.raises(TrialFileError) as caught:
        TrialReader(put(data[: int(share * len(data))]))
    assert caught.value.path.name in str(caught.value)
    if share > 0.1:
        assert "traction recover" in caught.value.hint


@pytest.mark.parametrize("missing", [1, 4, 8, 9, 37])
def test_a_file_that_lacks_its_last_bytes_is_refused(put, pristine, missing):
    with pytest.raises(TrialFileError, match="cut off"):
        TrialReader(put(pristine[0][:-missing]))


@pytest.mark.parametrize(
    "opcode",
    [CHUNK, INDEX, ATTACHMENT, CHUNK_INDEX, STATISTICS, METADATA],
    ids=["chunk", "index", "attachment", "chunk-index", "statistics", "metadata"],
)
@pytest.mark.parametrize("bit", [0, 7])
def test_a_flipped_bit_is_detected(put, pristine, opcode, bit):
    data = pristine[0]
    span = span_of(data, opcode)
    with pytest.raises(TrialFileError):
        TrialReader(put(flipped(data, (span.body + span.end) // 2, bit)))


def test_a_flipped_bit_in_a_name_of_the_summary_is_detected(put, pristine):
    data = pristine[0]
    at = data.index(b"/joint_states", summary_start(data))
    with pytest.raises(TrialFileError, match="summary whose checksum"):
        TrialReader(put(flipped(data, at)))


def test_a_flipped_bit_in_the_operators_name_is_detected(put, pristine):
    data = pristine[0]
    with pytest.raises(TrialFileError, match="data whose checksum"):
        TrialReader(put(flipped(data, data.index(b"session") + 11)))


def test_a_chunk_with_an_absurd_length_is_refused(put, pristine):
    data = pristine[0]
    at = span_of(data, CHUNK).start + 1
    path = put(resealed(patched(data, at, "<Q", 2**40)))
    with pytest.raises(TrialFileError):
        TrialReader(path).cycles()


def test_chunk_data_with_an_absurd_length_are_refused(put, pristine):
    data = pristine[0]
    at = span_of(data, CHUNK).body + 28 + 4 + len(b"zstd")
    path = put(resealed(patched(data, at, "<Q", 2**40)))
    with pytest.raises(TrialFileError, match="impossible length"):
        TrialReader(path).cycles()


@pytest.mark.parametrize("opcode", [METADATA, ATTACHMENT])
def test_a_record_with_an_absurd_length_is_refused(put, pristine, opcode):
    data = pristine[0]
    at = span_of(data, opcode).start + 1
    with pytest.raises(TrialFileError):
        TrialReader(put(resealed(patched(data, at, "<Q", 2**40))))


def chunk_index_field(data, offset, form, value):
    """Return a resealed `data` with a field of its first chunk index changed."""
    index = span_of(data, CHUNK_INDEX)
    return resealed(patched(data, index.body + offset, form, value))


def test_a_chunk_beyond_the_end_is_refused(put, pristine):
    path = put(chunk_index_field(pristine[0], 16, "<Q", 2**62))
    with pytest.raises(TrialFileError, match="beyond its end"):
        TrialReader(path)


def index_tail(data):
    """Return the offset of the compression name of the first chunk index."""
    body = span_of(data, CHUNK_INDEX).body
    offsets = struct.unpack_from("<I", data, body + 32)[0]
    return 36 + offsets + 8


def test_a_chunk_that_declares_too_large_a_size_is_not_unpacked(put, pristine):
    data = pristine[0]
    at = index_tail(data) + 4 + 4 + 8
    path = put(chunk_index_field(data, at, "<Q", RECORD_LIMIT + 1))
    with pytest.raises(TrialFileError, match="16 MiB"):
        TrialReader(path).cycles()


def test_chunks_that_declare_an_absurd_size_are_refused_at_once(put, pristine):
    data = pristine[0]
    path = put(chunk_index_field(data, index_tail(data) + 16, "<Q", 2**50))
    with pytest.raises(TrialFileError, match="chunks of"):
        TrialReader(path)


def test_a_message_index_with_an_absurd_length_is_refused(put, pristine):
    data = pristine[0]
    index = next(s for s in spans(data) if s.opcode == INDEX and s.end - s.body > 300)
    path = put(resealed(patched(data, index.body + 2, "<I", 2**31)))
    with pytest.raises(TrialFileError, match="damaged message index"):
        TrialReader(path).cycles()


@pytest.mark.parametrize(
    ("back", "what"), [(8 + 29, "no footer"), (None, "no end of data")]
)
def test_a_file_without_its_footer_or_data_end_is_refused(put, pristine, back, what):
    data = pristine[0]
    at = len(data) - back if back else summary_start(data) - 13
    with pytest.raises(TrialFileError, match=what):
        TrialReader(put(resealed(patched(data, at, "<B", 99))))


def test_an_unknown_compression_is_refused(put, pristine):
    data = pristine[0]
    path = put(resealed(patched(data, span_of(data, CHUNK).body + 32, "<4s", b"zip1")))
    with pytest.raises(TrialFileError, match="'zip1'"):
        TrialReader(path).cycles()


def test_an_index_that_names_another_compression_is_refused(put, pristine):
    data = pristine[0]
    path = put(chunk_index_field(data, index_tail(data) + 4, "<4s", b"zip1"))
    with pytest.raises(TrialFileError, match="does not match"):
        TrialReader(path).cycles()


def test_an_index_into_the_middle_of_a_message_is_refused(put, pristine):
    data = pristine[0]
    index = next(s for s in spans(data) if s.opcode == INDEX and s.end - s.body > 300)
    offset = struct.unpack_from("<Q", data, index.body + 14)[0]
    path = put(resealed(patched(data, index.body + 14, "<Q", offset + 1)))
    with pytest.raises(TrialFileError, match="points at no message"):
        TrialReader(path).cycles()


def test_an_index_outside_its_chunk_is_refused(put, pristine):
    data = pristine[0]
    index = next(s for s in spans(data) if s.opcode == INDEX and s.end - s.body > 300)
    path = put(resealed(patched(data, index.body + 14, "<Q", 2**63)))
    with pytest.raises(TrialFileError, match="outside its chunk"):
        TrialReader(path).cycles()


def test_an_absurd_number_of_announced_messages_is_refused(put, pristine):
    data = pristine[0]
    statistics = span_of(data, STATISTICS)
    counts = statistics.body + 8 + 2 + 4 * 4 + 8 + 8 + 4
    changed = data
    for at in range(counts, statistics.end, 10):
        changed = patched(changed, at + 2, "<Q", 10**9)
    with pytest.raises(TrialFileError, match="claims 1000000000"):
        TrialReader(put(resealed(changed))).cycles()


def test_fewer_messages_than_announced_are_refused(put, pristine):
    data = pristine[0]
    statistics = span_of(data, STATISTICS)
    counts = statistics.body + 8 + 2 + 4 * 4 + 8 + 8 + 4
    changed = data
    for at in range(counts, statistics.end, 10):
        changed = patched(changed, at + 2, "<Q", 301)
    with pytest.raises(TrialFileError, match="301 announced"):
        TrialReader(put(resealed(changed))).cycles()


@pytest.mark.parametrize("compression", ["", "lz4", "zstd"])
def test_a_hand_made_chunk_of_every_compression_is_read(put, compression):
    raw = chunk_content(compression=compression)
    path = put(with_chunk(PACKERS[compression](raw), len(raw), compression))
    assert TrialReader(path).cycles().data.tobytes() == CYCLE.template


@pytest.mark.parametrize("compression", ["", "lz4", "zstd"])
@pytest.mark.parametrize("error", [-1, 1])
def test_a_chunk_of_another_size_than_declared_is_refused(put, compression, error):
    raw = chunk_content(compression=compression)
    path = put(with_chunk(PACKERS[compression](raw), len(raw) + error, compression))
    with pytest.raises(TrialFileError):
        TrialReader(path).cycles()


@pytest.mark.parametrize("compression", ["", "lz4", "zstd"])
@pytest.mark.parametrize("chunk_size", [700, 65_536])
def test_every_compression_is_read_as_by_rosbags(put, compression, chunk_size):
    data = packed_trial(make_cycles(200), compression, chunk_size=chunk_size)
    path = put(data)
    rows = TrialReader(path).cycles()
    theirs = messages_of(path)["/cycle"]
    assert rows.data.tobytes() == b"".join(content for _, content in theirs)
    assert rows.log_time.tolist() == [time for time, _ in theirs]


def test_other_comments_in_the_definition_change_nothing(put):
    text = schema_text(CYCLE.type_name).replace("# rad", "# in radians")
    path = put(one_message(schema=text))
    assert TrialReader(path).cycles().data.tobytes() == CYCLE.template


def test_fields_in_another_order_are_not_misread(put):
    text = schema_text(CYCLE.type_name)
    swapped = text.replace("] position", "] x").replace("] velocity", "] position")
    path = put(one_message(schema=swapped.replace("] x", "] velocity")))
    with pytest.raises(TrialFileError, match="other fields"):
        TrialReader(path).cycles()


def test_a_pipe_is_refused_without_waiting(tmp_path):
    path = tmp_path / "T.mcap"
    os.mkfifo(path)
    with pytest.raises(TrialFileError, match="is a pipe"):
        TrialReader(path)


def test_an_oversized_file_is_not_read(put):
    path = put(b"\x89MCAP0\r\n")
    os.truncate(path, size_limit(path) + 1)  # sparse: uses no space
    with pytest.raises(TrialFileError, match=f"{size_limit(path) + 1} bytes"):
        TrialReader(path)


def test_a_frame_that_declares_an_excessive_size_is_not_unpacked(put):
    raw = bytearray(zstandard.ZstdCompressor().compress(chunk_content()))
    # a frame header that needs eight bytes for its content size: descriptor 0xC0
    bomb = bytes(raw[:4]) + b"\xc0\x58" + struct.pack("<Q", 4 * GIB) + raw[7:]
    assert zstandard.frame_content_size(bomb) == 4 * GIB
    path = put(with_chunk(bomb, len(chunk_content())))
    with pytest.raises(TrialFileError, match=f"unpack to {4 * GIB} bytes"):
        TrialReader(path).cycles()


def test_a_frame_of_unknown_size_is_not_unpacked_beyond_the_declared_size(put):
    compressor = zstandard.ZstdCompressor(write_content_size=False)
    bomb = compressor.compress(bytes(32 * 2**20))
    path = put(with_chunk(bomb, len(chunk_content())))
    with pytest.raises(TrialFileError):
        TrialReader(path).cycles()


def test_a_valid_frame_of_unknown_size_is_read(put):
    raw = chunk_content()
    payload = zstandard.ZstdCompressor(write_content_size=False).compress(raw)
    assert len(TrialReader(put(with_chunk(payload, len(raw)))).cycles().data) == 1


def test_a_big_endian_message_is_not_misread(put):
    raw = chunk_content(b"\x00\x00" + CYCLE.template[2:])
    payload = zstandard.ZstdCompressor().compress(raw)
    with pytest.raises(TrialFileError, match="unknown layout"):
        TrialReader(put(with_chunk(payload, len(raw)))).cycles()


def test_a_message_in_another_frame_is_not_misread(put):
    raw = chunk_content(CYCLE.template.replace(b"wam_base", b"map_base"))
    payload = zstandard.ZstdCompressor().compress(raw)
    with pytest.raises(TrialFileError, match="unknown layout"):
        TrialReader(put(with_chunk(payload, len(raw)))).cycles()


def test_a_wrong_chunk_checksum_is_detected_even_if_the_file_is_sealed(put, pristine):
    data = pristine[0]
    at = span_of(data, CHUNK).body + 24
    path = put(resealed(flipped(data, at)))
    with pytest.raises(TrialFileError, match="chunk whose checksum"):
        TrialReader(path).cycles()


@pytest.mark.parametrize("seed", range(4))
def test_a_forged_file_raises_nothing_but_trial_file_errors(put, pristine, seed):
    data, _ = pristine
    path = put(data)
    rng = np.random.default_rng(100 + seed)
    start = summary_start(data)
    refused = []
    for _ in range(50):
        at = int(rng.integers(8 if rng.integers(2) else start, len(data) - 16))
        noise = rng.bytes(int(rng.integers(1, 9)))
        changed = data[:at] + noise + data[at + len(noise) :]
        path.write_bytes(resealed(changed))
        try:
            verify_file(path)
            everything(path)
        except TrialFileError as error:
            refused.append(error.path)
    assert set(refused) == {path}


def test_the_repaired_checksums_of_these_tests_are_right(pristine):
    data = pristine[0]
    assert resealed(data) == data
    assert (
        zlib.crc32(data[summary_start(data) : -12])
        == struct.unpack("<I", data[-12:-8])[0]
    )
