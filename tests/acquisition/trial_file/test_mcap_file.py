"""The file is the one that the mcap library would have written, byte by byte."""

from io import BytesIO

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from acquisition.trial_file.mcap_file import McapFile

CHUNK_BYTES = 2000


def library_writer(file):
    return Writer(
        file,
        chunk_size=CHUNK_BYTES,
        compression=CompressionType.ZSTD,
        enable_data_crcs=True,
    )


def written(make, fill):
    file = BytesIO()
    writer = make(file)
    writer.start("ros2", "a test")
    fill(writer)
    writer.finish()
    return file.getvalue()


def both(fill):
    return (
        written(lambda file: McapFile(file, CHUNK_BYTES), fill),
        written(library_writer, fill),
    )


def two_channels(writer):
    schema = writer.register_schema("a/msg/A", "ros2msg", b"int32 a")
    second = writer.register_channel("/second", "cdr", schema, {"key": "value"})
    return writer.register_channel("/first", "cdr", schema), second


@pytest.mark.parametrize("messages", [0, 1, 40, 300])
def test_messages_of_some_chunks_are_written_like_that(messages):
    def fill(writer):
        channels = two_channels(writer)
        random = np.random.default_rng(messages)
        for number in range(messages):
            t_ns = int(random.integers(1, 2**62))
            data = random.bytes(int(random.integers(0, 90)))
            channel = channels[int(random.integers(0, 2))]
            writer.add_message(channel, t_ns, data, t_ns + 1, number)

    ours, theirs = both(fill)
    assert ours == theirs


def test_a_message_larger_than_a_chunk_is_written_like_that():
    def fill(writer):
        channel, _ = two_channels(writer)
        for size in (10, 3 * CHUNK_BYTES, 0):
            writer.add_message(channel, 5, bytes(size), 4)

    ours, theirs = both(fill)
    assert ours == theirs


def test_metadata_and_attachments_between_messages_are_written_like_that():
    def fill(writer):
        writer.add_metadata("trial", {"terrain": "S0", "empty": ""})
        writer.add_attachment(0, 7, "rig.toml", "text/plain", b"[rig]")
        channel, other = two_channels(writer)
        writer.add_message(channel, 9, b"abc", 9)
        writer.flush()
        writer.add_metadata("result", {})
        writer.add_message(other, 8, b"", 8, 3)
        writer.add_metadata("late", {"a": "b"})
        writer.flush()
        writer.flush()

    ours, theirs = both(fill)
    assert ours == theirs


def test_a_channel_without_a_schema_is_written_like_that():
    def fill(writer):
        writer.add_message(writer.register_channel("/x", "json", 0), 1, b"{}", 2)

    ours, theirs = both(fill)
    assert ours == theirs
