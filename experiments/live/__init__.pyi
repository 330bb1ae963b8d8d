from .channels import (
    DESCRIPTION_TOPIC,
    EVENTS_TOPIC,
    FORESIGHT_TOPIC,
    LIVE_TOPICS,
    LiveEncoder,
    stamped_foresight,
)
from .server import HOST, PORT, LiveServer, PlaybackWish, layout_path
from .watching import watch

__all__ = [
    "DESCRIPTION_TOPIC",
    "EVENTS_TOPIC",
    "FORESIGHT_TOPIC",
    "HOST",
    "LIVE_TOPICS",
    "PORT",
    "LiveEncoder",
    "LiveServer",
    "PlaybackWish",
    "layout_path",
    "stamped_foresight",
    "watch",
]
