"""Standard ROS messages with the content of a cycle, for generic viewers."""

import struct
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.cdr import NS_PER_S, CdrWriter
from acquisition.sample import Record
from acquisition.schema import CYCLE

JOINT_NAMES = [f"wam_j{joint}" for joint in range(1, 8)]
VIEW_TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/wrench": "geometry_msgs/msg/WrenchStamped",
    "/foot/pose": "geometry_msgs/msg/PoseStamped",
    "/foot/twist": "geometry_msgs/msg/TwistStamped",
}
_STAMP: Final = struct.Struct("<iI")
_STAMP_AT: Final = 4  # directly after the encapsulation
_CAN_FRAME: Final = np.dtype(
    [("can_id", "<u4"), ("length", "u1"), ("gap", "V3"), ("data", "V8")]
)


@dataclass(frozen=True, slots=True)
class _View:
    """A message of constant layout.

    Attributes:
        template: message with zeros for stamp and numbers.
        parts: (slice of the message, slice of the cycle's bytes) for each field.
    """

    template: bytes
    parts: tuple[tuple[slice, slice], ...]

    def filled(self, cycle: bytes, seconds: int, nanoseconds: int) -> bytes:
        """Return the message of one cycle."""
        data = bytearray(self.template)
        _STAMP.pack_into(data, _STAMP_AT, seconds, nanoseconds)
        for target, source in self.parts:
            data[target] = cycle[source]
        return bytes(data)


def encode_views(record: np.void, log_time: int) -> dict[str, bytes]:
    """Return the CDR payloads of one traction_msgs/Cycle record, by topic.

    Args:
        record: one record in the layout of `acquisition.schema.CYCLE`.
        log_time: UTC of the cycle [ns].
    """
    cycle = record.tobytes()
    stamp = divmod(log_time, NS_PER_S)
    return {topic: view.filled(cycle, *stamp) for topic, view in _VIEWS.items()}


def _joint_states() -> _View:
    writer = CdrWriter().header(0, "wam_base").strings(JOINT_NAMES)
    fields = ("position", "velocity", "torque_command")
    return _view(writer, fields, are_counted=True)


def _view(
    writer: CdrWriter, fields: tuple[str, ...], *, are_counted: bool = False
) -> _View:
    """Return the view that appends `fields` of a cycle to `writer`."""
    empty = np.zeros((), CYCLE.dtype)
    assert CYCLE.dtype.fields is not None
    offsets = {field: entry[1] for field, entry in CYCLE.dtype.fields.items()}
    append = writer.sequence if are_counted else writer.array
    parts: list[tuple[slice, slice]] = []
    for name in fields:
        numbers = empty[name]
        append(numbers)
        end, start = len(writer.finish()), offsets[name]
        target = slice(end - numbers.nbytes, end)
        parts.append((target, slice(start, start + numbers.nbytes)))
    return _View(writer.finish(), tuple(parts))


def _header(frame_id: str) -> CdrWriter:
    return CdrWriter().header(0, frame_id)


_VIEWS: Final = {
    "/joint_states": _joint_states(),
    "/wrench": _view(_header("ft_sensor"), ("wrench",)),
    "/foot/pose": _view(_header("wam_base"), ("foot_position", "foot_orientation")),
    "/foot/twist": _view(_header("wam_base"), ("foot_velocity",)),
}


def encode_can_batch(log_time: int, frames: Record) -> bytes:
    """Return a traction_msgs/CanBatch payload of struct can_frame records."""
    raw = np.zeros(len(frames), _CAN_FRAME)
    for name in ("can_id", "length", "data"):
        raw[name] = frames[name]
    writer = CdrWriter().header(log_time, "can")
    writer.sequence(np.ascontiguousarray(frames["t_ns"]))
    return writer.sequence(raw.view(np.uint8)).finish()
