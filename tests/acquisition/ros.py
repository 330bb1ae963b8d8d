"""Messages decoded and encoded by an independent ROS 2 library."""

from functools import cache
from typing import Any

from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from acquisition.schema import schema_text


@cache
def _store(type_name):
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema_text(type_name), type_name))
    return store


def decode(type_name, payload) -> Any:
    """Return the message in `payload`, decoded by the schema text of `type_name`."""
    return _store(type_name).deserialize_cdr(payload, type_name)


def encode(type_name, message):
    """Return `message` (a result of `decode`) serialised by the other library."""
    return bytes(_store(type_name).serialize_cdr(message, type_name))


def messages_of(path):
    """Return topic -> [(log time, payload)] of the trial file at `path`."""
    reader = McapReader(path)
    reader.open()
    try:
        by_topic = {connection.topic: [] for connection in reader.connections}
        for connection, time, data in reader.messages(reader.connections):
            by_topic[connection.topic].append((time, bytes(data)))
    finally:
        reader.close()
    return by_topic
