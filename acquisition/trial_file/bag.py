"""MCAP files for other programs: any topics, with embedded definitions."""

import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from mcap.writer import CompressionType, Writer

from acquisition.schema import schema_text
from acquisition.trial_file.writer import CHUNK_BYTES


@dataclass(frozen=True, slots=True)
class BagMessage:
    """One message of a bag.

    Attributes:
        topic: topic of the message.
        log_time: UTC [ns].
        data: CDR payload.
        publish_time: UTC [ns]; None = the log time.
        sequence: sequence number.
    """

    topic: str
    log_time: int
    data: bytes
    publish_time: int | None = None
    sequence: int = 0


def bag_bytes(
    topics: Mapping[str, str],
    messages: Iterable[BagMessage],
    metadata: Mapping[str, Mapping[str, str]],
    attachments: Mapping[str, bytes] | None = None,
) -> bytes:
    """Return an MCAP file that `ros2 bag play`, rosbags and Foxglove read.

    Args:
        topics: ROS 2 types of `acquisition.schema`, by topic.
        messages: messages in order.
        metadata: metadata by name of the record.
        attachments: contents by file name.
    """
    out = io.BytesIO()
    writer = Writer(out, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
    writer.start(profile="ros2", library="traction")
    for name, texts in metadata.items():
        writer.add_metadata(name, dict(texts))
    for name, content in (attachments or {}).items():
        writer.add_attachment(0, 0, name, "text/plain", content)
    channels: dict[str, int] = {}
    for topic, type_name in topics.items():
        text = schema_text(type_name).encode()
        schema = writer.register_schema(type_name, "ros2msg", text)
        channels[topic] = writer.register_channel(topic, "cdr", schema)
    for message in messages:
        published = (
            message.log_time if message.publish_time is None else message.publish_time
        )
        number = message.sequence & 0xFFFFFFFF
        writer.add_message(
            channels[message.topic], message.log_time, message.data, published, number
        )
    writer.finish()
    return out.getvalue()
