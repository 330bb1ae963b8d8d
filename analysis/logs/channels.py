"""Joint and wrench channels of a log: topics, values and times.

Nothing is repaired. Unusable messages are counted and reported with their cause.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.logs.clocks import ClockLine, Nanoseconds, fit_clock
from analysis.logs.log_file import MOST_MESSAGES, LogFile, LogMessage, LogTopic
from analysis.logs.messages import (
    MessageError,
    read_joints,
    read_wrench,
)

By = Literal["stamp", "receipt"]
FASTEST_JOINT = 30.0  # rad/s, m/s; a faster change is a jump in the data
_ABSURD = 1e9  # N, N m, rad beyond which a value cannot be a measurement
_DISTINCT = 0.9  # smallest share of messages with distinct times
_AWAY = 0.02  # rad, m between a row of zeros and its neighbours
_FEW = 0.01  # largest share of messages without stamp that are dropped
_STUCK = 0.2  # s of an unchanged reading
_TIMES = 20.0  # multiple of the mean duration of a reading
_NS = 1e-9
_LISTED = 12  # names listed in a message


@dataclass(frozen=True, slots=True)
class MessageTimes:
    """Times of the messages of a topic, and counts of unused messages.

    Attributes:
        times_ns: times of the used messages [ns], increasing, shape (n,).
        by: clock of these times: "stamp" or "receipt".
        read: number of messages of the topic.
        left_out: number of unused messages by cause.
        repeated: messages dropped because their time is a duplicate.
        overtaken: messages out of order; they are sorted.
        rate_by_stamp: median rate by stamps [Hz]; NaN without stamps.
        rate_by_receipt: median rate by receipt [Hz].
        late: median and maximum of receipt minus stamp [s]; NaN without stamps.
        widest: longest time between two messages [s].
        fit: line fit of receipt minus stamp; None without stamps.
    """

    times_ns: Nanoseconds
    by: By
    read: int
    left_out: dict[str, int]
    repeated: int
    overtaken: int
    rate_by_stamp: float
    rate_by_receipt: float
    late: tuple[float, float]
    widest: float
    fit: ClockLine | None

    @property
    def text(self) -> str:
        """Counts of read, used and dropped messages in words."""
        causes = [f"{count} {cause}" for cause, count in self.left_out.items() if count]
        if self.repeated:
            causes.append(f"{self.repeated} with a duplicate time")
        about = f"; left out: {', '.join(causes)}" if causes else ""
        return f"{self.read} messages, {len(self.times_ns)} used{about}"


@dataclass(frozen=True, slots=True)
class JointChannel:
    """Joint positions of a robot over time.

    Attributes:
        topic: source topic.
        clock: times.
        q: positions [rad, m], shape (n, joints), in the requested order.
        warnings: warnings for the user.
    """

    topic: LogTopic
    clock: MessageTimes
    q: Array
    warnings: Sequence[str]


@dataclass(frozen=True, slots=True)
class WrenchChannel:
    """Wrench of a sensor over time.

    Attributes:
        topic: source topic.
        frame_id: frame in the message header; empty in many logs.
        clock: times.
        wrench: raw readings [N, N m], shape (n, 6).
        stuck: first and last time [ns] of every reading unchanged for too long.
    """

    topic: LogTopic
    frame_id: str
    clock: MessageTimes
    wrench: Array
    stuck: Sequence[tuple[int, int]]


def choose_topic(
    log: LogFile, type_name: str, named: str | None, option: str
) -> LogTopic:
    """Choose the topic of a type: the named one, or the only one.

    Raises:
        SettingsError: there is none, there are several and none is named, or the named
            one has another type.
    """
    matches = [topic for topic in log.topics.values() if topic.type_name == type_name]
    names = ", ".join(topic.name for topic in matches[:_LISTED]) or "none"
    if named is not None:
        topic = log.topics.get(named)
        what = "is not in the log" if topic is None else f"is a {topic.type_name[:80]}"
        if topic is None or topic.type_name != type_name:
            raise SettingsError(
                f"{log.path}: {option} {named[:80]} {what}.",
                hint=f"Topics of {type_name}: {names}.",
            )
        return topic
    if len(matches) != 1:
        loss = "".join(f" Of the log {text}." for text in log.losses[:1])
        raise SettingsError(
            f"{log.path}: {len(matches) or 'no'} topics of {type_name}.{loss}",
            hint=f"Name one by {option}: {names}."
            if matches
            else "Record joints and wrench into one log; --list shows its topics.",
        )
    return matches[0]


def read_channels(
    log: LogFile,
    joints: LogTopic,
    names: Sequence[str],
    wrench: LogTopic,
    clock: By | None,
) -> tuple[JointChannel, WrenchChannel]:
    """Read both channels in one pass through a log.

    Args:
        log: the log.
        joints: topic of the joints.
        names: names of the joints in the desired order.
        wrench: topic of the wrench.
        clock: clock to use; None = the stamps.

    Raises:
        SettingsError: a message is damaged, there are too many, or the requested clock
            is unusable.
    """
    of_joints, of_wrench = _JointRows(joints, names), _WrenchRows(wrench)
    readers: dict[str, _Rows] = {joints.name: of_joints, wrench.name: of_wrench}
    for message in log.messages(readers):
        readers[message.topic].take(log, message)
    return of_joints.channel(log, clock), of_wrench.channel(log, clock)


@dataclass
class _Rows:
    """Collects the rows of one topic: times and a few numbers per message."""

    topic: LogTopic
    width: int = 0
    read: int = 0
    left_out: dict[str, int] = field(default_factory=dict[str, int])
    stamps: array[int] = field(default_factory=lambda: array("q"))
    received: array[int] = field(default_factory=lambda: array("q"))
    values: array[float] = field(default_factory=lambda: array("d"))

    def take(self, log: LogFile, message: LogMessage) -> None:
        """Decode a message and store its row; raises SettingsError."""
        self.read += 1
        if self.read > MOST_MESSAGES:
            raise SettingsError(
                f"{log.path}: over {MOST_MESSAGES} messages of {self.topic.name}.",
                hint="Cut the log.",
            )
        try:
            stamp_ns, row, cause = self.row(message)
        except MessageError as error:
            raise SettingsError(
                f"{log.path}: message {self.read} of {self.topic.name} does not match "
                f"its type ({error}).",
                hint="Was it recorded with another version of the type?",
            ) from error
        if not -(2**63) <= message.received_ns < 2**63:
            cause = "with an invalid time of receipt"
        if cause:
            self.leave_out(cause)
            return
        self.stamps.append(stamp_ns)
        self.received.append(message.received_ns)
        self.values.extend(row)

    def row(self, message: LogMessage) -> tuple[int, Sequence[float], str]:
        """Return stamp, numbers and the reason why they are unusable ("" = none)."""
        raise NotImplementedError

    def leave_out(self, cause: str) -> None:
        """Count an unused message by cause."""
        self.left_out[cause] = self.left_out.get(cause, 0) + 1

    def clocked(self, log: LogFile, clock: By | None) -> tuple[Array, MessageTimes]:
        """Return the rows in time order with their times; raises SettingsError."""
        name, count = self.topic.name, len(self.received)
        if count < 3:
            causes = [f"{n} {cause}" for cause, n in self.left_out.items()]
            about = f" ({', '.join(causes)})" if causes else ""
            raise SettingsError(
                f"{log.path}: {count} usable messages of {self.read} of {name}{about}.",
                hint="--list shows how many messages each topic has.",
            )
        stamps = np.frombuffer(self.stamps, np.int64)
        received = np.frombuffer(self.received, np.int64)
        values = np.frombuffer(self.values).reshape(-1, self.width)
        is_unset = stamps <= 0
        if 0 < np.count_nonzero(is_unset) <= _FEW * count:
            self.left_out["without a stamp"] = int(np.count_nonzero(is_unset))
            stamps, received = stamps[~is_unset], received[~is_unset]
            values, count = values[~is_unset], len(stamps)
        unset = int(np.count_nonzero(stamps <= 0))
        is_clock = not unset and _share_distinct(stamps) >= _DISTINCT
        fit = fit_clock(stamps, received) if is_clock else None
        if clock == "receipt":
            times = received
            if fit is not None and not fit.has_step:
                times = fit.recorder_times(stamps, received)
        else:
            _require_stamps(log, name, stamps, unset)
            times = stamps
        if _share_distinct(times) < _DISTINCT:
            raise SettingsError(
                f"{log.path}: {name} was received at {len(np.unique(times))} times for "
                f"{count} messages, which does not distinguish the messages.",
                hint="Record it again; without times there is no velocity.",
            )
        order = np.argsort(times, kind="stable")
        in_order = times[order]
        is_new = np.concatenate([[True], np.diff(in_order) > 0])
        return values[order][is_new], MessageTimes(
            in_order[is_new],
            clock or "stamp",
            self.read,
            self.left_out,
            int(np.count_nonzero(~is_new)),
            int(np.count_nonzero(times < np.maximum.accumulate(times))),
            _rate(np.sort(stamps)) if is_clock else np.nan,
            _rate(np.sort(received)),
            _late(received, stamps) if is_clock else (np.nan, np.nan),
            float(np.diff(in_order[is_new]).max()) * _NS,
            fit,
        )


def _require_stamps(log: LogFile, name: str, stamps: Nanoseconds, unset: int) -> None:
    count = len(stamps)
    if unset:
        raise SettingsError(
            f"{log.path}: {unset} of {count} stamps of {name} are not set.",
            hint="--clock receipt takes the recorder's times.",
        )
    if _share_distinct(stamps) < _DISTINCT:
        repeated = count - len(np.unique(stamps))
        raise SettingsError(
            f"{log.path}: {repeated} of {count} messages of {name} have the stamp of "
            "another one.",
            hint="Is the recording in the log twice? --clock receipt takes the "
            "recorder's times.",
        )


class _JointRows(_Rows):
    """Rows of the joints of the leg, selected by name."""

    def __init__(self, topic: LogTopic, names: Sequence[str]) -> None:
        super().__init__(topic, len(names))
        self._wanted = list(names)
        self._seen: tuple[str, ...] = ()
        self._order: list[int] = []
        self._without_velocity = 0

    def row(self, message: LogMessage) -> tuple[int, Sequence[float], str]:
        joints = read_joints(message.data, self.topic.serialization)
        if joints.names != self._seen:
            index = {name: k for k, name in enumerate(joints.names)}
            order = [index.get(name, -1) for name in self._wanted]
            self._seen, self._order = joints.names, [] if -1 in order else order
        stamp_ns = joints.header.stamp_ns
        if not self._order:
            lacking = next(name for name in self._wanted if name not in joints.names)
            return stamp_ns, joints.position, f"without joint {lacking} of the URDF"
        if len(joints.position) != len(joints.names):
            return (
                stamp_ns,
                joints.position,
                "with different numbers of names and positions",
            )
        row = [joints.position[k] for k in self._order]
        if not _is_measured(row):
            return stamp_ns, row, "with invalid positions"
        if len(joints.velocity) and not _is_measured(joints.velocity):
            self._without_velocity += 1
        return stamp_ns, row, ""

    def channel(self, log: LogFile, clock: By | None) -> JointChannel:
        q, clocked = self.clocked(log, clock)
        name, warnings = self.topic.name, list[str]()
        if self._without_velocity:
            warnings.append(
                f"{name}: {self._without_velocity} messages with invalid velocities; "
                "velocities are computed from the positions in any case"
            )
        is_zero = _lone_zeros(q)
        if is_zero.any():
            times = clocked.times_ns
            at = (times[is_zero] - times[0]).astype(np.float64) * _NS
            shown = ", ".join(f"{t:.3f}" for t in at[:_LISTED])
            warnings.append(
                f"{name}: {len(at)} messages with all joints at zero, unlike those "
                f"before and after them, are dropped: at {shown} s of the log"
            )
            clocked.left_out["with all joints at zero"] = len(at)
            clocked = replace(clocked, times_ns=times[~is_zero])
            q = q[~is_zero]
        return JointChannel(self.topic, clocked, q, warnings)


def _lone_zeros(q: Array) -> NDArray[np.bool_]:
    """Return the rows of exact zeros that are far from the adjacent other rows."""
    is_zero = (q == 0.0).all(axis=1)
    others = np.flatnonzero(~is_zero)
    if not is_zero.any() or len(others) < 2:
        return np.zeros(len(q), bool)
    rows = np.flatnonzero(is_zero)
    after = np.searchsorted(others, rows)
    is_far = np.ones(len(rows), bool)
    for side, exists in ((after - 1, after > 0), (after, after < len(others))):
        near = np.abs(q[others[np.clip(side, 0, len(others) - 1)]]).max(axis=1)
        is_far &= ~exists | (near > _AWAY)
    is_lone = np.zeros(len(q), bool)
    is_lone[rows[is_far]] = True
    return is_lone


def require_no_jump(channel: JointChannel) -> None:
    """Refuse joints that move impossibly fast.

    Raises:
        SettingsError: a joint jumps; the message states time and positions.
    """
    times, q, name = channel.clock.times_ns, channel.q, channel.topic.name
    steps = np.diff(times).astype(np.float64)[:, None] * _NS
    changes = np.abs(np.diff(q, axis=0))
    speed = np.where(changes > _AWAY, changes / steps, 0.0)
    if len(speed) and float(speed.max()) > FASTEST_JOINT:
        row, joint = np.unravel_index(int(speed.argmax()), speed.shape)
        at = float(times[row] - times[0]) * _NS
        raise SettingsError(
            f"{name} jumps {at:.3f} s after its first message: joint "
            f"{int(joint) + 1} of the leg goes from {q[row, joint]:.3f} to "
            f"{q[row + 1, joint]:.3f} in {float(steps[row, 0]) * 1e3:.2f} ms.",
            hint=f"No joint moves faster than {FASTEST_JOINT:g} rad/s or m/s. Give "
            "positions in rad or m; cut the log where it jumps once.",
        )


class _WrenchRows(_Rows):
    """Rows of force and torque."""

    def __init__(self, topic: LogTopic) -> None:
        super().__init__(topic, 6)
        self._frame_id = ""

    def row(self, message: LogMessage) -> tuple[int, Sequence[float], str]:
        header, wrench = read_wrench(message.data, self.topic.serialization)
        self._frame_id = self._frame_id or header.frame_id
        cause = "" if _is_measured(wrench) else "with invalid readings"
        return header.stamp_ns, wrench, cause

    def channel(self, log: LogFile, clock: By | None) -> WrenchChannel:
        wrench, clocked = self.clocked(log, clock)
        stuck = _stuck_spans(clocked.times_ns, wrench)
        return WrenchChannel(self.topic, self._frame_id, clocked, wrench, stuck)


def _stuck_spans(times: Nanoseconds, wrench: Array) -> list[tuple[int, int]]:
    """Return first and last time [ns] of readings unchanged for too long.

    The limit is 0.2 s and 20 times the mean duration of a reading, so that a driver
    that repeats every reading, or a simulation without noise, is not reported.
    """
    is_new = (np.diff(wrench, axis=0) != 0.0).any(axis=1)
    first = np.concatenate([[0], np.flatnonzero(is_new) + 1])
    last = np.concatenate([first[1:] - 1, [len(wrench) - 1]])
    spans = (times[last] - times[first]).astype(np.float64) * _NS
    usual = float(times[-1] - times[0]) * _NS / len(first)
    rows = np.flatnonzero(spans >= max(_STUCK, _TIMES * usual))
    return [(int(times[first[k]]), int(times[last[k]])) for k in rows]


def _is_measured(values: Sequence[float]) -> bool:
    return all(-_ABSURD < value < _ABSURD for value in values)  # False for NaN


def _share_distinct(times: Nanoseconds) -> float:
    return len(np.unique(times)) / len(times)


def _rate(times: Nanoseconds) -> float:
    """Return the message rate by the median time between two messages [Hz]."""
    steps = np.diff(times)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else np.nan
    return 1.0 / (step * _NS)


def _late(received: Nanoseconds, stamps: Nanoseconds) -> tuple[float, float]:
    late = (received - stamps).astype(np.float64) * _NS
    return float(np.median(late)), float(late.max())
