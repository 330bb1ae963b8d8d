"""Hand-made MCAP files: other profiles, and chunks of any content."""

import io
import struct

import lz4.frame
import zstandard
from mcap.writer import CompressionType, Writer

from acquisition.formats import FORMAT
from acquisition.schema import CYCLE, schema_text
from tests.acquisition.trials import resealed, span_of

CHUNK, CHUNK_INDEX = 6, 8
COMPRESSIONS = {
    "": CompressionType.NONE,
    "lz4": CompressionType.LZ4,
    "zstd": CompressionType.ZSTD,
}
PACKERS = {"": bytes, "lz4": lz4.frame.compress, "zstd": zstandard.compress}
UNPACKERS = {"": bytes, "lz4": lz4.frame.decompress, "zstd": zstandard.decompress}
CHUNK_FIELDS = 8 + 8 + 8 + 4 + 4 + 8  # of a chunk's head, without the compression
HEAD_TO_OFFSETS = 36  # of a chunk index
OFFSET_ENTRY = 10


def foreign(profile, name="trial", data_crcs=True):
    """Return a small MCAP file without messages."""
    out = io.BytesIO()
    writer = Writer(out, enable_data_crcs=data_crcs)
    writer.start(profile=profile, library="other")
    writer.add_metadata(name, {"format_version": FORMAT})
    writer.finish()
    return out.getvalue()


def one_message(compression="zstd", schema=None):
    """Return a sealed trial with one message of `/cycle` in its only chunk."""
    out = io.BytesIO()
    writer = Writer(out, compression=COMPRESSIONS[compression], enable_data_crcs=True)
    writer.start(profile="ros2", library="hostile")
    writer.add_metadata("trial", {"session": "S", "format_version": FORMAT})
    text = schema_text(CYCLE.type_name) if schema is None else schema
    number = writer.register_schema(CYCLE.type_name, "ros2msg", text.encode())
    channel = writer.register_channel("/cycle", "cdr", number)
    writer.add_message(channel, 0, CYCLE.template, 0)
    writer.finish()
    return out.getvalue()


def chunk_content(message=CYCLE.template, compression="zstd"):
    """Return the unpacked content of that chunk, with `message` as its message."""
    data = one_message(compression)
    chunk = span_of(data, CHUNK)
    packed = data[chunk.body + CHUNK_FIELDS + len(compression) : chunk.end]
    return UNPACKERS[compression](packed)[: -CYCLE.size] + message


def with_chunk(payload, size, compression="zstd"):
    """Return that trial with a chunk of `payload` that declares a `size` [bytes]."""
    data = one_message(compression)
    chunk = span_of(data, CHUNK)
    name = compression.encode()
    head = struct.pack("<QQQII", 0, 0, size, 0, len(name)) + name
    body = head + struct.pack("<Q", len(payload)) + payload
    record = struct.pack("<BQ", CHUNK, len(body)) + body
    shift = len(record) - (chunk.end - chunk.start)
    changed = bytearray(data)
    at = span_of(data, CHUNK_INDEX).body
    struct.pack_into("<Q", changed, at + 24, len(record))
    position = at + HEAD_TO_OFFSETS + 2
    (offset,) = struct.unpack_from("<Q", data, position)
    struct.pack_into("<Q", changed, position, offset + shift)
    sizes = at + HEAD_TO_OFFSETS + OFFSET_ENTRY + 8 + 4 + len(name)
    struct.pack_into("<QQ", changed, sizes, len(payload), size)
    footer = len(data) - 8 - 29 + 9
    summary, offsets = struct.unpack_from("<QQ", data, footer)
    struct.pack_into("<QQ", changed, footer, summary + shift, offsets + shift)
    return resealed(bytes(changed[: chunk.start]) + record + changed[chunk.end :])


def packed_trial(cycles, compression, **options):
    """Return a trial with `cycles`, written by the library's own writer."""
    out = io.BytesIO()
    kind = COMPRESSIONS[compression]
    writer = Writer(out, compression=kind, enable_data_crcs=True, **options)
    writer.start(profile="ros2", library="other")
    writer.add_metadata("trial", {"session": "S", "format_version": FORMAT})
    text = schema_text(CYCLE.type_name).encode()
    schema = writer.register_schema(CYCLE.type_name, "ros2msg", text)
    other = writer.register_channel("/other", "cdr", schema)
    channel = writer.register_channel("/cycle", "cdr", schema)
    for record in cycles:
        t_ns = int(record["host_ns"])
        writer.add_message(channel, t_ns, record.tobytes(), t_ns, int(record["cycle"]))
        writer.add_message(other, t_ns, CYCLE.template[:20], t_ns)
    writer.finish()
    return out.getvalue()


def with_repeated_index(data, times):
    """Return `data` whose summary names its first chunk `times` more often."""
    index = span_of(data, CHUNK_INDEX)
    again = data[index.start : index.end] * times
    return resealed(data[: index.end] + again + data[index.end :])


def padded_content(size):
    """Return the content of the one chunk, filled up to `size` bytes."""
    content = chunk_content()
    gap = size - len(content) - 9
    return content + struct.pack("<BQ", 0x80, gap) + bytes(gap)
