"""Damaged and hostile files: an error with the path in it, at once, or the truth."""

import io
import struct
import zlib

import numpy as np
import pytest
import zstandard
from mcap.writer import Writer

from acquisition.errors import TrialFileError
from acquisition.messages import CYCLE, schema_text
from acquisition.recorder import seal
from acquisition.trial_file.reader import RECORD_LIMIT, TrialReader
from acquisition.trial_file.verify import verify
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
    """Return what a reader can be asked for."""
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
def test_a_foreign_file_is_no_trial(put, content):
    with pytest.raises(TrialFileError, match="no MCAP file"):
        TrialReader(put(content))


def test_two_magics_alone_are_no_trial(put):
    with pytest.raises(TrialFileError):
        TrialReader(put(b"\x89MCAP0\r\n" * 2))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(TrialFileError, match=r"T99\.mcap"):
        TrialReader(tmp_path / "T99.mcap")


def test_a_folder_is_no_trial(tmp_path):
    with pytest.raises(TrialFileError):
        TrialReader(tmp_path)


def foreign(profile, name="trial", data_crcs=True):
    out = io.BytesIO()
    writer = Writer(out, enable_data_crcs=data_crcs)
    writer.start(profile=profile, library="other")
    writer.add_metadata(name, {"a": "b"})
    writer.finish()
    return out.getvalue()


def test_another_profile_is_said(put):
    with pytest.raises(TrialFileError, match="profile 'ros1'"):
        TrialReader(put(foreign("ros1")))


def test_another_ros_recording_is_no_trial(put):
    with pytest.raises(TrialFileError, match="no trial of Traction"):
        TrialReader(put(foreign("ros2", "route")))


def test_a_file_without_checksums_is_refused(put):
    with pytest.raises(TrialFileError, match="data whose checksum"):
        TrialReader(put(foreign("ros2", data_crcs=False)))


def test_a_trial_without_cycles_says_so(put):
    with pytest.raises(TrialFileError, match="no topic /cycle"):
        TrialReader(put(foreign("ros2"))).cycles()


@pytest.mark.parametrize("share", np.linspace(0.0, 0.9999, 20))
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
@pytest.mark.parametrize("bit", range(8))
def test_a_flipped_bit_is_noticed(put, pristine, opcode, bit):
    data = pristine[0]
    span = span_of(data, opcode)
    with pytest.raises(TrialFileError):
        TrialReader(put(flipped(data, (span.body + span.end) // 2, bit)))


def test_a_flipped_bit_in_a_name_of_the_summary_is_noticed(put, pristine):
    data = pristine[0]
    at = data.index(b"/joint_states", summary_start(data))
    with pytest.raises(TrialFileError, match="summary whose checksum"):
        TrialReader(put(flipped(data, at)))


def test_a_flipped_bit_in_the_operators_name_is_noticed(put, pristine):
    data = pristine[0]
    with pytest.raises(TrialFileError, match="data whose checksum"):
        TrialReader(put(flipped(data, data.index(b"session") + 11)))


def test_a_chunk_of_two_to_the_forty_bytes_is_refused(put, pristine):
    data = pristine[0]
    at = span_of(data, CHUNK).start + 1
    path = put(resealed(patched(data, at, "<Q", 2**40)))
    with pytest.raises(TrialFileError):
        TrialReader(path).cycles()


def test_chunk_data_of_two_to_the_forty_bytes_are_refused(put, pristine):
    data = pristine[0]
    at = span_of(data, CHUNK).body + 28 + 4 + len(b"zstd")
    path = put(resealed(patched(data, at, "<Q", 2**40)))
    with pytest.raises(TrialFileError, match="impossible length"):
        TrialReader(path).cycles()


@pytest.mark.parametrize("opcode", [METADATA, ATTACHMENT])
def test_a_record_of_two_to_the_forty_bytes_is_refused(put, pristine, opcode):
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
    """Return where the compression name of the first chunk index begins."""
    body = span_of(data, CHUNK_INDEX).body
    offsets = struct.unpack_from("<I", data, body + 32)[0]
    return 36 + offsets + 8


def test_a_chunk_that_states_too_much_is_not_unpacked(put, pristine):
    data = pristine[0]
    at = index_tail(data) + 4 + 4 + 8
    path = put(chunk_index_field(data, at, "<Q", RECORD_LIMIT + 1))
    with pytest.raises(TrialFileError, match="16 MiB"):
        TrialReader(path).cycles()


def test_chunks_that_state_a_petabyte_are_refused_at_once(put, pristine):
    data = pristine[0]
    path = put(chunk_index_field(data, index_tail(data) + 16, "<Q", 2**50))
    with pytest.raises(TrialFileError, match="chunks of"):
        TrialReader(path)


def test_a_message_index_of_two_gigabytes_is_not_read(put, pristine):
    data = pristine[0]
    index = next(s for s in spans(data) if s.opcode == INDEX and s.end - s.body > 300)
    path = put(resealed(patched(data, index.body + 2, "<I", 2**31)))
    with pytest.raises(TrialFileError, match="damaged message index"):
        TrialReader(path).cycles()


@pytest.mark.parametrize(
    ("back", "what"), [(8 + 29, "no footer"), (None, "no end of data")]
)
def test_section_ends_must_be_where_they_belong(put, pristine, back, what):
    data = pristine[0]
    at = len(data) - back if back else summary_start(data) - 13
    with pytest.raises(TrialFileError, match=what):
        TrialReader(put(resealed(patched(data, at, "<B", 99))))


def test_an_unknown_compression_is_refused(put, pristine):
    data = pristine[0]
    path = put(chunk_index_field(data, index_tail(data) + 4, "<4s", b"zip1"))
    with pytest.raises(TrialFileError, match="'zip1'"):
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


def test_a_billion_announced_messages_are_refused(put, pristine):
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


def one_message():
    """Return a sealed trial with one message of `/cycle` in its only chunk."""
    out = io.BytesIO()
    writer = Writer(out, enable_data_crcs=True)
    writer.start(profile="ros2", library="hostile")
    writer.add_metadata("trial", {"session": "S"})
    schema = writer.register_schema(
        CYCLE.type_name, "ros2msg", schema_text(CYCLE.type_name).encode()
    )
    channel = writer.register_channel("/cycle", "cdr", schema)
    writer.add_message(channel, 0, CYCLE.template, 0)
    writer.finish()
    return out.getvalue()


def chunk_content(message=CYCLE.template):
    """Return what that chunk unpacks to, with another `message` in it."""
    data = one_message()
    chunk = span_of(data, CHUNK)
    raw = zstandard.ZstdDecompressor().decompress(data[chunk.body + 44 : chunk.end])
    return raw[: -CYCLE.size] + message


def with_chunk(payload, size):
    """Return that trial with a chunk of `payload`, said to unpack to `size` bytes."""
    data = one_message()
    chunk = span_of(data, CHUNK)
    head = struct.pack("<QQQII", 0, 0, size, 0, 4) + b"zstd"
    body = head + struct.pack("<Q", len(payload)) + payload
    record = struct.pack("<BQ", CHUNK, len(body)) + body
    shift = len(record) - (chunk.end - chunk.start)
    return moved(data, chunk, record, shift, size)


def moved(data, chunk, record, shift, size):
    """Return `data` with `chunk` replaced and every offset after it put right."""
    index = span_of(data, CHUNK_INDEX)
    changed = bytearray(data)
    at = index.body
    (start,) = struct.unpack_from("<Q", data, at + 16)
    struct.pack_into("<QQ", changed, at + 16, start, len(record))
    (offset,) = struct.unpack_from("<Q", data, at + 36 + 2)
    struct.pack_into("<Q", changed, at + 36 + 2, offset + shift)
    stored = len(record) - 9 - 28 - 4 - 4 - 8
    struct.pack_into("<QQ", changed, at + 36 + 10 + 8 + 4 + 4, stored, size)
    footer = len(data) - 8 - 29 + 9
    summary, offsets = struct.unpack_from("<QQ", data, footer)
    struct.pack_into("<QQ", changed, footer, summary + shift, offsets + shift)
    return resealed(bytes(changed[: chunk.start]) + record + changed[chunk.end :])


def test_an_honest_hand_made_chunk_is_read(put):
    raw = chunk_content()
    payload = zstandard.ZstdCompressor().compress(raw)
    rows = TrialReader(put(with_chunk(payload, len(raw)))).cycles()
    assert rows.data.tobytes() == CYCLE.template


def test_a_frame_that_states_4_gib_is_not_unpacked(put):
    raw = bytearray(zstandard.ZstdCompressor().compress(chunk_content()))
    # a frame header that needs eight bytes for its content size: descriptor 0xC0
    bomb = bytes(raw[:4]) + b"\xc0\x58" + struct.pack("<Q", 4 * GIB) + raw[7:]
    assert zstandard.frame_content_size(bomb) == 4 * GIB
    path = put(with_chunk(bomb, len(chunk_content())))
    with pytest.raises(TrialFileError, match=f"unpack to {4 * GIB} bytes"):
        TrialReader(path).cycles()


def test_a_frame_of_unknown_size_is_not_unpacked_beyond_what_is_stated(put):
    compressor = zstandard.ZstdCompressor(write_content_size=False)
    bomb = compressor.compress(bytes(32 * 2**20))
    path = put(with_chunk(bomb, len(chunk_content())))
    with pytest.raises(TrialFileError):
        TrialReader(path).cycles()


def test_a_frame_of_unknown_size_that_is_honest_is_read(put):
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


def test_a_wrong_chunk_checksum_is_noticed_even_when_the_file_is_sealed(put, pristine):
    data = pristine[0]
    at = span_of(data, CHUNK).body + 24
    path = put(resealed(flipped(data, at)))
    with pytest.raises(TrialFileError, match="chunk whose checksum"):
        TrialReader(path).cycles()


def mutated(data, rng):
    """Return `data` with one flip, cut or splice somewhere."""
    kind = rng.integers(3)
    at = int(rng.integers(len(data)))
    if kind == 0:
        return flipped(data, at, int(rng.integers(8)))
    length = int(rng.integers(1, 200))
    if kind == 1:
        return data[:at] + data[at + length :]
    source = int(rng.integers(len(data)))
    return data[:at] + data[source : source + length] + data[at:]


@pytest.mark.parametrize("seed", range(4))
def test_a_mutated_file_is_refused_or_right(put, pristine, seed):
    data, cycles = pristine
    path = put(data)
    whole = everything(path)
    rng = np.random.default_rng(seed)
    refused = 0
    for _ in range(50):
        path.write_bytes(mutated(data, rng))
        try:
            found, metadata, attachments = everything(path)
        except TrialFileError:
            refused += 1
        else:
            assert found.tobytes() == cycles.tobytes()
            assert (metadata, attachments) == whole[1:]
    assert refused > 45  # next to nothing in the file is without meaning


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
            verify(path)
            everything(path)
        except TrialFileError as error:
            refused.append(error.path)
    assert set(refused) == {path}


def test_the_mended_checksums_of_these_tests_are_right(pristine):
    data = pristine[0]
    assert resealed(data) == data
    assert (
        zlib.crc32(data[summary_start(data) : -12])
        == struct.unpack("<I", data[-12:-8])[0]
    )
