"""Joints and wrench of a log over time: which topics they are, and when it was."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.logs.decoding import MessageError, decoded, value_at
from analysis.logs.definitions import (
    DefinitionError,
    MessageField,
    MessageType,
    message_type,
)
from analysis.logs.log_file import MOST_MESSAGES, LogFile, LogTopic

JOINT_STATE = "sensor_msgs/JointState"
MOST_JOINTS = 10_000
_AXES = ("x", "y", "z")
_WRENCH_SIZE = 6
_ABSURD = 1e9  # N, N m, rad: what is beyond was never measured
_DISTINCT = 0.9  # share of the messages whose times differ
_LONGEST_DELAY = 2.0  # s of buffers; where delays differ by more, the stamps jump
_NS = 1e-9
_LISTED = 12  # names in a refusal
# Types that look like what is wanted and hold no force along the ground.
_NO_TRACTION = {
    "unitree_go/LowState": "foot_force is the raw count of a pressure bulb",
    "unitree_legged_msgs/LowState": "footForce is the raw count of a pressure bulb",
}
NO_TANGENTIAL = "it holds no force along the ground, so no traction can follow from it"


@dataclass(frozen=True, slots=True)
class Clocked:
    """When the messages of a topic were, and what became of those that are not used.

    Attributes:
        times_ns: of every message that is used [UTC ns], increasing, shape (n,).
        by: "stamp" or "receipt".
        read: messages of the topic.
        repeated: of them with the time of the one before.
        overtaken: of them that stand behind a later one; they are put in order.
        jump: largest less smallest receipt less stamp [s].
        rate_by_stamp: of the messages by their stamps [Hz]; nan where they have none.
        rate_by_receipt: of the messages by their receipt [Hz], from the median.
        late: receipt less stamp in the median and at most [s]; nan without stamps.
        widest: longest time between two messages [s].
    """

    times_ns: NDArray[np.int64]
    by: str
    read: int
    repeated: int
    overtaken: int
    jump: float
    rate_by_stamp: float
    rate_by_receipt: float
    late: tuple[float, float]
    widest: float


@dataclass(frozen=True, slots=True)
class JointChannel:
    """The joints of a robot over time.

    Attributes:
        topic: where they come from.
        clock: when it was.
        q: positions [rad, m], shape (n, joints), in the order asked for.
        qd: velocities as the log has them, shape (n, joints); None where it has none.
        incomplete: messages without one of the joints.
    """

    topic: LogTopic
    clock: Clocked
    q: Array
    qd: Array | None
    incomplete: int


@dataclass(frozen=True, slots=True)
class WrenchChannel:
    """The wrench of a sensor over time.

    Attributes:
        topic: where it comes from.
        field: path of the wrench in the message.
        frame_id: what its header names; empty in many logs.
        clock: when it was.
        wrench: as recorded [N, N m], shape (n, 6).
        lost_numbers: messages whose numbers were not finite, or absurd.
    """

    topic: LogTopic
    field: str
    frame_id: str
    clock: Clocked
    wrench: Array
    lost_numbers: int


@dataclass(frozen=True, slots=True)
class WrenchField:
    """Where in a message a wrench stands.

    Attributes:
        path: names of the fields down to it.
        is_array: it is six numbers, not force and torque.
    """

    path: tuple[str, ...]
    is_array: bool

    def of(self, message: dict[str, Any]) -> tuple[float, ...]:
        """Return fx fy fz tx ty tz [N, N m]."""
        found = value_at(message, self.path) if self.path else message
        if self.is_array:
            return tuple(float(x) for x in found)
        force, torque = found["force"], found["torque"]
        return tuple(float(part[axis]) for part in (force, torque) for axis in _AXES)


def joint_states(log: LogFile) -> list[LogTopic]:
    """Return the topics that hold states of joints."""
    return [t for t in log.topics.values() if t.type_name == JOINT_STATE]


def choose_joints(log: LogFile, name: str | None) -> LogTopic:
    """Return the topic of the joints; raises SettingsError."""
    states = joint_states(log)
    if name is not None:
        topic = _named(log, name)
        if topic.type_name != JOINT_STATE:
            raise SettingsError(
                f"{log.path}: {name} is a {topic.type_name[:80]}, not a {JOINT_STATE}.",
                hint=_offer("joints", "--joints", states),
            )
        return topic
    if len(states) == 1:
        return states[0]
    if not states:
        raise SettingsError(
            f"{log.path}: no topic of {JOINT_STATE}, so no motion: without the joints "
            f"there is no velocity of the foot.{_losses(log)}",
            hint="Record the joints and the wrench into one log. --list shows the "
            "topics.",
        )
    raise SettingsError(
        f"{log.path}: {len(states)} topics of {JOINT_STATE}.",
        hint=_offer("joints", "--joints", states),
    )


def choose_wrench(log: LogFile, named: str | None) -> tuple[LogTopic, WrenchField]:
    """Return the topic of the wrench and where the wrench stands in its messages.

    Args:
        log: whose topics they are.
        named: TOPIC or TOPIC:FIELD, FIELD with points between names; None = the only
            topic that holds a wrench.

    Raises:
        SettingsError: there is none, or several, or the field is no wrench.
    """
    if named is None:
        found = {
            topic.name: fields[0]
            for topic in log.topics.values()
            if (fields := wrench_fields(topic)) and not fields[0].is_array
        }
        if len(found) == 1:
            ((name, field),) = found.items()
            return log.topics[name], field
        _refuse_counts(log)
        raise SettingsError(
            f"{log.path}: {len(found) or 'no'} topics with a wrench.{_losses(log)}",
            hint=_offer("wrench", "--wrench", [log.topics[name] for name in found]),
        )
    name, _, wanted = named.partition(":")
    topic = _named(log, name)
    fields = wrench_fields(topic)
    if wanted:
        path = tuple(wanted.split("."))
        for field in fields:
            if field.path == path:
                return topic, field
    elif fields and not (fields[0].is_array and len(fields) > 1):
        return topic, fields[0]
    if topic.type_name in _NO_TRACTION:
        _refuse_counts(log)
    about = ", ".join(".".join(f.path) for f in fields[:_LISTED]) or "none"
    raise SettingsError(
        f"{log.path}: {name} is a {topic.type_name[:80]}; "
        + (
            f"{wanted[:60]!r} in it is no wrench." if wanted else "which is its wrench?"
        ),
        hint=f"Fields that look like one: {about}.",
    )


def wrench_fields(topic: LogTopic) -> list[WrenchField]:
    """Return where a wrench may stand in the messages of a topic, the surest first."""
    try:
        kind = _type_of(topic)
    except SettingsError:
        return []
    structured = [WrenchField((), False)] if _is_wrench(kind) else []
    arrays: list[WrenchField] = []
    for path, field in kind.paths():
        if (
            field.nested is not None
            and field.count is None
            and _is_wrench(field.nested)
        ):
            structured.append(WrenchField(path, False))
        elif field.count == _WRENCH_SIZE and field.code in {"f4", "f8"}:
            arrays.append(WrenchField(path, True))
    return structured + arrays


def _is_wrench(kind: MessageType) -> bool:
    return all(_is_vector(kind.field(name)) for name in ("force", "torque"))


def _is_vector(field: MessageField | None) -> bool:
    if field is None or field.nested is None or field.count is not None:
        return False
    parts = [field.nested.field(axis) for axis in _AXES]
    return all(p is not None and p.code in {"f4", "f8"} for p in parts)


def _refuse_counts(log: LogFile) -> None:
    """Refuse what looks like a force and is none, with that sentence."""
    for topic in log.topics.values():
        if topic.type_name in _NO_TRACTION:
            raise SettingsError(
                f"{log.path}: {topic.name}: {_NO_TRACTION[topic.type_name]}; "
                f"{NO_TANGENTIAL}.",
                hint="Mount a six-axis sensor at the foot and record its wrench.",
            )


def _losses(log: LogFile) -> str:
    """Return what of a log could not be read, as a sentence; "" for nothing."""
    return "".join(f" Of the log {loss}." for loss in log.losses[:1])


def _named(log: LogFile, name: str) -> LogTopic:
    if name not in log.topics:
        listed = ", ".join(sorted(log.topics)[:_LISTED]) or "none"
        raise SettingsError(
            f"{log.path}: no topic {name[:80]!r}.", hint=f"It has {listed}."
        )
    return log.topics[name]


def _offer(what: str, option: str, topics: Sequence[LogTopic]) -> str:
    if not topics:
        return "--list shows the topics and their types."
    names = ", ".join(topic.name for topic in topics[:_LISTED])
    return f"Name that of the {what} by {option}: {names}."


@lru_cache(maxsize=256)
def _type_of(topic: LogTopic) -> MessageType:
    try:
        return message_type(topic.type_name, topic.definition, topic.serialization)
    except DefinitionError as error:
        raise SettingsError(
            f"{topic.name}: the type {topic.type_name[:80]} cannot be read: {error}.",
            hint="Record it as geometry_msgs/WrenchStamped or sensor_msgs/JointState.",
        ) from error


def stamp_path(kind: MessageType, near: tuple[str, ...]) -> tuple[str, ...] | None:
    """Return the path of the stamp that dates a field: of its own header, or above."""
    paths = {path for path, _ in kind.paths()}
    for depth in range(len(near), -1, -1):
        path = (*near[:depth], "header", "stamp")
        if (*path, "sec") in paths:
            return path
    return None


def stamp_of(topic: LogTopic, data: bytes) -> tuple[int, str]:
    """Return stamp [UTC ns] and frame of a message that begins with a header.

    0 and "" where it has none, or is damaged.
    """
    try:
        kind = _type_of(topic)
        first = kind.fields[0]
        if first.nested is None or first.nested.name != "std_msgs/Header":
            return 0, ""
        head = MessageType(kind.name, (first,))
        header = decoded(data, head, topic.serialization)[first.name]
    except (SettingsError, MessageError, IndexError):
        return 0, ""
    stamp = header["stamp"]
    return stamp["sec"] * 10**9 + stamp["nanosec"], header["frame_id"]


class ChannelReader:
    """Reads joints and wrench in one pass through a log."""

    def __init__(
        self,
        joints: LogTopic,
        names: Sequence[str],
        wrench: tuple[LogTopic, WrenchField],
    ) -> None:
        """Say which topics, joints and field are read; raises SettingsError."""
        self._joints = _TopicRows(joints, (), 2 * len(names))
        self._wrench = _TopicRows(wrench[0], wrench[1].path, _WRENCH_SIZE)
        self._names = list(names)
        self._field = wrench[1]
        self.incomplete = 0
        self._has_velocity = True
        self._order: tuple[tuple[str, ...], list[int]] = ((), [])

    def read(
        self, log: LogFile, clock: str | None
    ) -> tuple[JointChannel, WrenchChannel]:
        """Return both channels.

        Args:
            log: it is read once.
            clock: "stamp" or "receipt"; None = stamps, where they can be used.

        Raises:
            SettingsError: a message is damaged, there are too many, or their times do
                not increase.
        """
        read_into(log, {self._joints: self._joint_row, self._wrench: self._wrench_row})
        joint_rows, joint_clock = self._joints.rows(log, clock)
        wrench_rows, wrench_clock = self._wrench.rows(log, clock)
        count = len(self._names)
        joints = JointChannel(
            self._joints.topic,
            joint_clock,
            joint_rows[:, :count],
            joint_rows[:, count:] if self._has_velocity else None,
            self.incomplete,
        )
        wrench = WrenchChannel(
            self._wrench.topic,
            ".".join(self._field.path),
            self._wrench.frame_id,
            wrench_clock,
            wrench_rows,
            self._wrench.lost_numbers,
        )
        return joints, wrench

    def _wrench_row(self, message: dict[str, Any]) -> Sequence[float]:
        return self._field.of(message)

    def _joint_row(self, message: dict[str, Any]) -> Sequence[float] | None:
        """Return positions and velocities in the order asked for."""
        names, position = tuple(message["name"]), message["position"]
        if names != self._order[0]:
            self._order = names, self._indices(names)
        order = self._order[1]
        if not order or len(position) != len(names):
            self.incomplete += 1  # another driver's part of the robot
            return None
        velocity = message["velocity"]
        if len(velocity) != len(names):
            self._has_velocity = False
            velocity = np.zeros(len(names))
        return [*(position[k] for k in order), *(velocity[k] for k in order)]

    def _indices(self, names: Sequence[str]) -> list[int]:
        if len(names) > MOST_JOINTS:
            raise MessageError(f"it names {len(names)} joints")
        try:
            return [names.index(name) for name in self._names]
        except ValueError:
            return []


def read_wrench(
    log: LogFile, wrench: tuple[LogTopic, WrenchField], clock: str | None
) -> WrenchChannel:
    """Return a wrench alone, e.g. of a log that was recorded for the tare."""
    topic, field = wrench
    collector = _TopicRows(topic, field.path, _WRENCH_SIZE)
    read_into(log, {collector: field.of})
    rows, clocked = collector.rows(log, clock)
    return WrenchChannel(
        topic,
        ".".join(field.path),
        collector.frame_id,
        clocked,
        rows,
        collector.lost_numbers,
    )


def read_into(log: LogFile, readers: dict[_TopicRows, Any]) -> None:
    """Read the messages of a log into the collectors of their topics."""
    by_topic = {each.topic.name: (each, row) for each, row in readers.items()}
    for message in log.messages(by_topic):
        collector, row_of = by_topic[message.topic]
        collector.take(log, message.received_ns, message.data, row_of)


class _TopicRows:
    """Gathers the rows of one topic; nine numbers a message at most for a wrench."""

    def __init__(self, topic: LogTopic, field: tuple[str, ...], width: int) -> None:
        self.topic = topic
        self.frame_id = ""
        self.lost_numbers = 0
        self._kind = _type_of(topic)
        self._stamp = stamp_path(self._kind, field)
        self._width = width
        self._stamps, self._received = array("q"), array("q")
        self._values = array("d")
        self._read = 0

    def take(self, log: LogFile, received_ns: int, data: bytes, row_of: Any) -> None:  # noqa: ANN401
        """Decode a message and keep its row; raises SettingsError."""
        self._read += 1
        if self._read > MOST_MESSAGES:
            raise SettingsError(
                f"{log.path}: over {MOST_MESSAGES} messages of {self.topic.name}.",
                hint="Cut the log.",
            )
        try:
            message = decoded(data, self._kind, self.topic.serialization)
            row = row_of(message)
            stamp_ns = self._stamp_of(message)
        except (MessageError, KeyError, TypeError, IndexError, ValueError) as error:
            raise SettingsError(
                f"{log.path}: message {self._read} of {self.topic.name} is not as its "
                f"type says ({error}).",
                hint="Was it recorded with another version of the type?",
            ) from error
        if row is None or not -(2**63) <= received_ns < 2**63:
            return
        if not all(-_ABSURD < value < _ABSURD for value in row):  # nan is not, either
            self.lost_numbers += 1
            return
        self._stamps.append(stamp_ns)
        self._received.append(received_ns)
        self._values.extend(row)

    def _stamp_of(self, message: dict[str, Any]) -> int:
        if self._stamp is None:
            return 0
        stamp = value_at(message, self._stamp)
        if not self.frame_id and len(self._stamp) > 1:
            self.frame_id = str(value_at(message, self._stamp[:-1])["frame_id"])
        return stamp["sec"] * 10**9 + stamp["nanosec"]

    def rows(self, log: LogFile, clock: str | None) -> tuple[Array, Clocked]:
        """Return the rows that are used, and when they were; raises SettingsError."""
        name = self.topic.name
        if len(self._received) < 3:
            raise SettingsError(
                f"{log.path}: {len(self._received)} usable messages of {self._read} of "
                f"{name}.",
                hint="--list shows how many messages each topic has.",
            )
        stamps = np.frombuffer(self._stamps, np.int64)
        received = np.frombuffer(self._received, np.int64)
        has_stamps = _is_clock(stamps) and bool((stamps > 0).all())
        jump = float(np.ptp(received - stamps)) * _NS if has_stamps else 0.0
        by = clock or ("stamp" if has_stamps and jump <= _LONGEST_DELAY else "receipt")
        times = stamps if by == "stamp" else received
        if (by == "stamp" and not has_stamps) or not _is_clock(times):
            raise SettingsError(
                f"{log.path}: the times of {name} do not increase, by stamp or by "
                "receipt.",
                hint="Record it again; without times there is no velocity.",
            )
        order = np.argsort(times, kind="stable")
        in_order = times[order]
        is_new = np.concatenate([[True], np.diff(in_order) > 0])
        clocked = Clocked(
            in_order[is_new],
            by,
            self._read,
            int(np.count_nonzero(~is_new)),
            int(np.count_nonzero(times < np.maximum.accumulate(times))),
            jump,
            _rate(np.sort(stamps)) if has_stamps else np.nan,
            _rate(np.sort(received)),
            _late(received, stamps) if has_stamps else (np.nan, np.nan),
            float(np.diff(in_order[is_new]).max()) * _NS,
        )
        values = np.frombuffer(self._values).reshape(-1, self._width)
        return values[order][is_new], clocked


def _is_clock(times: NDArray[np.int64]) -> bool:
    """Return whether times tell messages apart: few are there twice."""
    return len(np.unique(times)) >= _DISTINCT * len(times)


def _rate(times: NDArray[np.int64]) -> float:
    """Return messages a second by the median time between two [Hz]."""
    steps = np.diff(times)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else np.nan
    return 1.0 / (step * _NS)


def _late(
    received: NDArray[np.int64], stamps: NDArray[np.int64]
) -> tuple[float, float]:
    late = (received - stamps).astype(np.float64) * _NS
    return float(np.median(late)), float(late.max())
