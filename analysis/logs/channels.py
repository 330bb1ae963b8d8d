"""Joints and wrench of a log over time: which topics they are, and when it was.

Nothing is repaired. A message that cannot be used is counted and named with its cause.
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
FASTEST_JOINT = 30.0  # rad/s, m/s; faster is a jump of the numbers
_ABSURD = 1e9  # N, N m, rad: what is beyond was never measured
_DISTINCT = 0.9  # share of the messages whose times differ
_AWAY = 0.02  # rad, m from both neighbours of a row of zeros
_FEW = 0.01  # of the messages may lack a stamp: they are left out
_STUCK = 0.2  # s of one and the same reading
_TIMES = 20.0  # the usual time of one reading, that no chance exceeds
_NS = 1e-9
_LISTED = 12  # names in a refusal


@dataclass(frozen=True, slots=True)
class Clocked:
    """When the messages of a topic were, and what became of those that are not used.

    Attributes:
        times_ns: of every message that is used [ns], increasing, shape (n,).
        by: "stamp" or "receipt".
        read: messages of the topic.
        left_out: how many are not used, by cause.
        repeated: of the used ones with the time of another one.
        overtaken: of them that stand behind a later one; they are put in order.
        rate_by_stamp: of the messages by their stamps [Hz]; nan where they have none.
        rate_by_receipt: of the messages by their receipt [Hz], from the median.
        late: receipt less stamp in the median and at most [s]; nan without stamps.
        widest: longest time between two messages [s].
        fit: of receipt less stamp; None without stamps.
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
        """What was read, used and left out, for people."""
        causes = [f"{count} {cause}" for cause, count in self.left_out.items() if count]
        if self.repeated:
            causes.append(f"{self.repeated} with the time of another one")
        about = f"; left out: {', '.join(causes)}" if causes else ""
        return f"{self.read} messages, {len(self.times_ns)} used{about}"


@dataclass(frozen=True, slots=True)
class JointChannel:
    """The joints of a robot over time.

    Attributes:
        topic: where they come from.
        clock: when it was.
        q: positions [rad, m], shape (n, joints), in the order asked for.
        warnings: what a person should know of them.
    """

    topic: LogTopic
    clock: Clocked
    q: Array
    warnings: Sequence[str]


@dataclass(frozen=True, slots=True)
class WrenchChannel:
    """The wrench of a sensor over time.

    Attributes:
        topic: where it comes from.
        frame_id: what its header names; empty in many logs.
        clock: when it was.
        wrench: as recorded [N, N m], shape (n, 6).
        stuck: first and last time [ns] of one and the same reading for too long.
    """

    topic: LogTopic
    frame_id: str
    clock: Clocked
    wrench: Array
    stuck: Sequence[tuple[int, int]]


def choose_topic(
    log: LogFile, type_name: str, named: str | None, option: str
) -> LogTopic:
    """The topic of a type: the one that is named, or the only one.

    Raises:
        SettingsError: there is none, or several and none is named, or another type.
    """
    found = [topic for topic in log.topics.values() if topic.type_name == type_name]
    names = ", ".join(topic.name for topic in found[:_LISTED]) or "none"
    if named is not None:
        topic = log.topics.get(named)
        what = "is not in the log" if topic is None else f"is a {topic.type_name[:80]}"
        if topic is None or topic.type_name != type_name:
            raise SettingsError(
                f"{log.path}: {option} {named[:80]} {what}.",
                hint=f"Topics of {type_name}: {names}.",
            )
        return topic
    if len(found) != 1:
        loss = "".join(f" Of the log {each}." for each in log.losses[:1])
        raise SettingsError(
            f"{log.path}: {len(found) or 'no'} topics of {type_name}.{loss}",
            hint=f"Name one by {option}: {names}."
            if found
            else "Record joints and wrench into one log; --list shows its topics.",
        )
    return found[0]


def read_channels(
    log: LogFile,
    joints: LogTopic,
    names: Sequence[str],
    wrench: LogTopic,
    clock: By | None,
) -> tuple[JointChannel, WrenchChannel]:
    """Both channels in one pass through a log.

    Args:
        log: it is read once.
        joints: topic of the joints.
        names: of the joints, in the order wanted.
        wrench: topic of the wrench.
        clock: as stated; None = the stamps.

    Raises:
        SettingsError: a message is damaged, there are too many, or the clock that is
            asked for is none.
    """
    of_joints, of_wrench = _JointRows(joints, names), _WrenchRows(wrench)
    readers: dict[str, _Rows] = {joints.name: of_joints, wrench.name: of_wrench}
    for message in log.messages(readers):
        readers[message.topic].take(log, message)
    return of_joints.channel(log, clock), of_wrench.channel(log, clock)


@dataclass
class _Rows:
    """Gathers the rows of one topic: times and a few numbers a message."""

    topic: LogTopic
    width: int = 0
    read: int = 0
    left_out: dict[str, int] = field(default_factory=dict[str, int])
    stamps: array[int] = field(default_factory=lambda: array("q"))
    received: array[int] = field(default_factory=lambda: array("q"))
    values: array[float] = field(default_factory=lambda: array("d"))

    def take(self, log: LogFile, message: LogMessage) -> None:
        """Decode a message and keep its row; raises SettingsError."""
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
                f"{log.path}: message {self.read} of {self.topic.name} is not as its "
                f"type says ({error}).",
                hint="Was it recorded with another version of the type?",
            ) from error
        if not -(2**63) <= message.received_ns < 2**63:
            cause = "with a time of receipt that is none"
        if cause:
            self.leave_out(cause)
            return
        self.stamps.append(stamp_ns)
        self.received.append(message.received_ns)
        self.values.extend(row.tolist())

    def row(self, message: LogMessage) -> tuple[int, Array, str]:
        """Stamp, numbers and why they cannot be used; "" where they can."""
        raise NotImplementedError

    def leave_out(self, cause: str) -> None:
        """Count a message that is not used."""
        self.left_out[cause] = self.left_out.get(cause, 0) + 1

    def clocked(self, log: LogFile, clock: By | None) -> tuple[Array, Clocked]:
        """The rows in order, and when they were; raises SettingsError."""
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
                f"{count} messages: they tell no messages apart.",
                hint="Record it again; without times there is no velocity.",
            )
        order = np.argsort(times, kind="stable")
        in_order = times[order]
        is_new = np.concatenate([[True], np.diff(in_order) > 0])
        return values[order][is_new], Clocked(
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
    """The joints of the leg, by name."""

    def __init__(self, topic: LogTopic, names: Sequence[str]) -> None:
        super().__init__(topic, len(names))
        self._wanted = list(names)
        self._seen: tuple[str, ...] = ()
        self._order: list[int] = []
        self._without_velocity = 0

    def row(self, message: LogMessage) -> tuple[int, Array, str]:
        joints = read_joints(message.data, self.topic.serialization)
        if joints.names != self._seen:
            places = {name: k for k, name in enumerate(joints.names)}
            found = [places.get(name, -1) for name in self._wanted]
            self._seen, self._order = joints.names, [] if -1 in found else found
        stamp_ns = joints.header.stamp_ns
        if not self._order:
            return stamp_ns, joints.position, "without a joint of the leg"
        if len(joints.position) != len(joints.names):
            return (
                stamp_ns,
                joints.position,
                "with a position for another count of names",
            )
        row = joints.position[self._order]
        if not _is_measured(row):
            return stamp_ns, row, "with positions that are no numbers"
        if len(joints.velocity) and not _is_measured(joints.velocity):
            self._without_velocity += 1
        return stamp_ns, row, ""

    def channel(self, log: LogFile, clock: By | None) -> JointChannel:
        q, clocked = self.clocked(log, clock)
        name, warnings = self.topic.name, list[str]()
        if self._without_velocity:
            warnings.append(
                f"{name}: {self._without_velocity} messages with velocities that are "
                "no numbers; velocities follow from the positions in any case"
            )
        is_zero = _lone_zeros(q)
        if is_zero.any():
            times = clocked.times_ns
            at = (times[is_zero] - times[0]).astype(np.float64) * _NS
            shown = ", ".join(f"{t:.3f}" for t in at[:_LISTED])
            warnings.append(
                f"{name}: {len(at)} messages with all joints at zero, away from those "
                f"before and after them, are left out: at {shown} s of the log"
            )
            clocked.left_out["with all joints at zero"] = len(at)
            clocked = replace(clocked, times_ns=times[~is_zero])
            q = q[~is_zero]
        return JointChannel(self.topic, clocked, q, warnings)


def _lone_zeros(q: Array) -> NDArray[np.bool_]:
    """Rows of exact zeros that are far from the last and the next other row."""
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
    found = np.zeros(len(q), bool)
    found[rows[is_far]] = True
    return found


def require_no_jump(channel: JointChannel) -> None:
    """Refuse joints that move faster than any does.

    Raises:
        SettingsError: they jump; the sentence says when, and from where to where.
    """
    times, q, name = channel.clock.times_ns, channel.q, channel.topic.name
    steps = np.diff(times).astype(np.float64)[:, None] * _NS
    ways = np.abs(np.diff(q, axis=0))
    speed = np.where(ways > _AWAY, ways / steps, 0.0)
    if len(speed) and float(speed.max()) > FASTEST_JOINT:
        row, joint = np.unravel_index(int(speed.argmax()), speed.shape)
        at = float(times[row] - times[0]) * _NS
        raise SettingsError(
            f"{name} jumps {at:.3f} s after its first message: joint "
            f"{int(joint) + 1} of the leg goes from {q[row, joint]:.3f} to "
            f"{q[row + 1, joint]:.3f} in {float(steps[row, 0]) * 1e3:.2f} ms.",
            hint=f"No joint moves faster than {FASTEST_JOINT:g} rad/s or m/s: cut the "
            "log there, or record it again.",
        )


class _WrenchRows(_Rows):
    """Force and torque."""

    def __init__(self, topic: LogTopic) -> None:
        super().__init__(topic, 6)
        self._frame_id = ""

    def row(self, message: LogMessage) -> tuple[int, Array, str]:
        header, wrench = read_wrench(message.data, self.topic.serialization)
        self._frame_id = self._frame_id or header.frame_id
        cause = "" if _is_measured(wrench) else "with readings that are no numbers"
        return header.stamp_ns, wrench, cause

    def channel(self, log: LogFile, clock: By | None) -> WrenchChannel:
        wrench, clocked = self.clocked(log, clock)
        stuck = _stuck_spans(clocked.times_ns, wrench)
        return WrenchChannel(self.topic, self._frame_id, clocked, wrench, stuck)


def _stuck_spans(times: Nanoseconds, wrench: Array) -> list[tuple[int, int]]:
    """First and last time [ns] of one and the same reading for too long.

    Too long is 0.2 s and 20 times as long as readings usually stay: a driver that
    repeats each of them, or a simulation without noise, sticks nowhere.
    """
    is_new = (np.diff(wrench, axis=0) != 0.0).any(axis=1)
    first = np.concatenate([[0], np.flatnonzero(is_new) + 1])
    last = np.concatenate([first[1:] - 1, [len(wrench) - 1]])
    spans = (times[last] - times[first]).astype(np.float64) * _NS
    usual = float(times[-1] - times[0]) * _NS / len(first)
    rows = np.flatnonzero(spans >= max(_STUCK, _TIMES * usual))
    return [(int(times[first[k]]), int(times[last[k]])) for k in rows]


def _is_measured(values: Array) -> bool:
    return bool((np.abs(values) < _ABSURD).all())  # nan is not, either


def _share_distinct(times: Nanoseconds) -> float:
    return len(np.unique(times)) / len(times)


def _rate(times: Nanoseconds) -> float:
    """Messages a second by the median time between two [Hz]."""
    steps = np.diff(times)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else np.nan
    return 1.0 / (step * _NS)


def _late(received: Nanoseconds, stamps: Nanoseconds) -> tuple[float, float]:
    late = (received - stamps).astype(np.float64) * _NS
    return float(np.median(late)), float(late.max())
