"""Messages as an independent ROS 2 library understands them."""

from functools import cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from acquisition.messages import schema_text


@cache
def _store(type_name):
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema_text(type_name), type_name))
    return store


def decode(type_name, payload):
    """Return the message in `payload`, decoded by the schema text of `type_name`."""
    return _store(type_name).deserialize_cdr(payload, type_name)


def encode(type_name, message):
    """Return `message` (as `decode` gives it) serialised by the other library."""
    return bytes(_store(type_name).serialize_cdr(message, type_name))
