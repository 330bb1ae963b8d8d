"""Translation of a bus log to text: requests, replies, delays and missing replies.

Each addressed device answers a GET once; a SET has no reply. The protocol has no
sequence numbers: a reply is matched to the oldest open request of its kind, and a
request repeated after the reply's time limit replaces the one before.
"""

from enum import Enum

from acquisition.clock import NS_PER_S
from acquisition.devices import SafetyMode
from wam.bus.error_frames import ERROR_FLAG, EXTENDED_FLAG, error_names
from wam.bus.frames import (
    HAND_NODES,
    HOST,
    MOTOR_NODES,
    SAFETY_NODE,
    SENSOR_NODE,
    Address,
    FrameError,
    Group,
    decode_acceleration,
    decode_force,
    decode_joint_encoder,
    decode_position,
    decode_reply,
    decode_request,
    decode_torque,
    decode_torques,
    split_id,
)
from wam.bus.log import JUMP_NS, BusSummary, DecodedLine, LoggedFrame
from wam.bus.properties import FIRST_RELEASED, Device, PuckMode, PuckStatus, names

REPLY_LIMIT_NS = 1_000_000  # replies after this are late
_GIVE_UP_NS = 1_000_000_000
_DEFAULT_VERS = 200  # assumed firmware where none was reported
_MEMBERS = {
    Group.BUS: range(1, 8),
    Group.LOWER_TORQUE: range(1, 5),
    Group.WRIST_TORQUE: range(5, 8),
    Group.ARM: range(1, 8),
    Group.HAND: HAND_NODES,
}
_GROUP_NAMES = {
    Group.BUS: "every puck",
    Group.LOWER_TORQUE: "pucks 1-4",
    Group.WRIST_TORQUE: "pucks 5-7",
    Group.ARM: "the arm",
    Group.HAND: "the hand",
}


class ReplyKind(Enum):
    """Replies other than property replies, by their destination group."""

    POSITION = Group.POSITION
    JOINT_ENCODER = Group.JOINT_ENCODER
    FORCE = Group.FORCE
    TORQUE = Group.TORQUE
    ACCELERATION = Group.ACCELERATION


def describe_id(can_id: int) -> str:
    """Return sender, receiver and purpose of an 11-bit identifier as text."""
    address = split_id(can_id)
    who = node_name(address.sender)
    if address.is_group and address.to == Group.PROPERTY:
        return f"{who} answers"
    if address.is_group and address.to in {kind.value for kind in ReplyKind}:
        return f"{who} reports its {ReplyKind(Group(address.to)).name.lower()}"
    if not address.is_group:
        return f"{who} to {node_name(address.to)}"
    is_named = address.to in _GROUP_NAMES
    whom = _GROUP_NAMES[Group(address.to)] if is_named else f"group {address.to}"
    return f"{who} to {whom}"


_SPECIAL = {
    (Device.MOTOR, "P"): (ReplyKind.POSITION,),
    (Device.MOTOR, "JP"): (ReplyKind.JOINT_ENCODER,),
    (Device.SENSOR, "FT"): (ReplyKind.FORCE, ReplyKind.TORQUE),
    (Device.SENSOR, "A"): (ReplyKind.ACCELERATION,),
}
_Key = tuple[int, ReplyKind | int]  # node; kind of reply or property number


def node_name(node: int) -> str:
    """Return the name of a bus node for people, such as "puck 3"."""
    named_nodes = {
        HOST: "host",
        SENSOR_NODE: "F/T sensor",
        SAFETY_NODE: "safety module",
    }
    if node in named_nodes:
        return named_nodes[node]
    return f"puck {node}" if node in MOTOR_NODES else f"node {node}"


class BusReader:
    """Decodes a log frame by frame; tracks firmware and sleep state of each node.

    Attributes:
        tally: totals so far.
    """

    def __init__(self) -> None:
        self.tally = BusSummary()
        self._open: dict[_Key, list[int]] = {}  # request times [ns], oldest key first
        self._vers: dict[int, int] = {}
        self._asleep: set[int] = set()
        self._newest_ns = 0

    def read(self, frame: LoggedFrame) -> list[DecodedLine]:
        """Return the text of `frame`, after lines for requests that have expired."""
        self.tally.frames += 1
        lines = self._expire(frame.utc_ns - _GIVE_UP_NS)
        lines += self._check_clock(frame.utc_ns)
        if not frame.is_of_wam:
            text = self._decode_foreign(frame)
            return [*lines, DecodedLine(frame.utc_ns, text)]
        address = split_id(frame.can_id)
        try:
            text = self._decode(frame, address, lines)
        except FrameError as error:
            text = f"{node_name(address.sender)}: {error.message}"
        return [*lines, DecodedLine(frame.utc_ns, text)]

    def finish(self) -> list[DecodedLine]:
        """Return the unanswered requests whose time limit ended within the log.

        A request still within its limit at the end is not counted: its reply may have
        come afterwards.
        """
        lines = self._expire(self._newest_ns - REPLY_LIMIT_NS)
        self.tally.questions -= sum(map(len, self._open.values()))
        return lines

    def _check_clock(self, utc_ns: int) -> list[DecodedLine]:
        """Return a line if the time since the previous frame is a gap or a jump."""
        passed_ns = utc_ns - self._newest_ns if self._newest_ns else 0
        self._newest_ns = utc_ns
        if passed_ns > JUMP_NS:
            self.tally.gaps += 1
            self.tally.longest_gap_ns = max(self.tally.longest_gap_ns, passed_ns)
            text = f"{passed_ns / NS_PER_S:.3f} s without a frame"
            return [DecodedLine(utc_ns, text)]
        if passed_ns < -JUMP_NS:
            self.tally.jumps += 1
            self.tally.questions -= sum(map(len, self._open.values()))
            self._open.clear()  # their request times are of another clock setting
            text = f"TIME GOES BACK by {-passed_ns / NS_PER_S:.3f} s"
            return [DecodedLine(utc_ns, text)]
        return []

    def _decode(
        self, frame: LoggedFrame, address: Address, lines: list[DecodedLine]
    ) -> str:
        if address.sender == HOST:
            return self._decode_host_frame(frame, address, lines)
        who = node_name(address.sender)
        if address.is_group and address.to == Group.PROPERTY:
            return self._decode_property_reply(frame, address.sender)
        if address.is_group and address.to in {answer.value for answer in ReplyKind}:
            answer = ReplyKind(Group(address.to))
            delay = self._match_reply((address.sender, answer), frame.utc_ns)
            return f"{who} {_describe(answer, frame.data)}{delay}"
        if address.is_group and address.to == Group.BUS:
            return f"{who} sends to every puck: {frame.data.hex(' ')}"
        return f"{who} sends {frame.can_id:03x} {frame.data.hex(' ')}"

    def _decode_foreign(self, frame: LoggedFrame) -> str:
        if frame.can_id & ERROR_FLAG and frame.can_id < EXTENDED_FLAG:
            names = error_names(frame.can_id, frame.data)
            self.tally.errors.update(names)
            return f"the controller reports: {', '.join(sorted(names))}"
        self.tally.foreign += 1
        return f"not a WAM frame: {frame.can_id:x}"

    def _decode_host_frame(
        self, frame: LoggedFrame, address: Address, lines: list[DecodedLine]
    ) -> str:
        nodes, whom = [address.to], node_name(address.to)
        if address.is_group:
            if address.to not in _MEMBERS:
                return f"host sends {frame.can_id:03x} {frame.data.hex(' ')}"
            group = Group(address.to)
            nodes, whom = list(_MEMBERS[group]), _GROUP_NAMES[group]
            if len(frame.data) == 8:
                units = decode_torques(frame.data)[: len(nodes)]
                return f"host sets torques of {whom}: {' '.join(map(str, units))}"
        request = decode_request(frame.data)
        name = self._name(nodes[0], request.number)
        if request.value is not None:
            value = self._value(nodes[0], name, request.value)
            if name == "STAT":  # a puck does not acknowledge that it is woken
                for node in nodes:
                    self._learn(node, name, request.value)
            return f"host sets {name} of {whom} to {value}"
        for node in nodes:
            for kind in self._answers_to(node, request.number):
                lines += self._note_request((node, kind), frame.utc_ns)
        return f"host asks {whom} for {name}"

    def _decode_property_reply(self, frame: LoggedFrame, node: int) -> str:
        reply = decode_reply(frame.data)
        value = reply.value or 0
        delay = self._match_reply((node, reply.number), frame.utc_ns)
        name = self._name(node, reply.number)
        self._learn(node, name, value)
        value_text = self._value(node, name, value)
        return f"{node_name(node)} answers {name} = {value_text}{delay}"

    def _learn(self, node: int, name: str, value: int) -> None:
        if name == "STAT":
            (self._asleep.add if value == PuckStatus.RESET else self._asleep.discard)(
                node
            )
        elif name == "VERS" and node not in self._asleep and value >= FIRST_RELEASED:
            self._vers[node] = value

    def _device(self, node: int) -> Device:
        if node in self._asleep:
            return Device.MONITOR
        special = {SAFETY_NODE: Device.SAFETY, SENSOR_NODE: Device.SENSOR}
        return special.get(node, Device.MOTOR)

    def _name(self, node: int, number: int) -> str:
        table = names(self._device(node), self._vers.get(node, _DEFAULT_VERS))
        return table.get(number, f"property {number}")

    def _value(self, node: int, name: str, value: int) -> str:
        words: dict[int, str] = {}
        if name == "STAT":
            words = {int(stat): stat.name for stat in PuckStatus}
        elif name == "MODE":
            modes = SafetyMode if node == SAFETY_NODE else PuckMode
            words = {int(mode): mode.name for mode in modes}
        elif name == "PEN":
            return f"{value & 0xFFFFFFFF:08X}"
        if value not in words:
            return str(value)
        return f"{value} ({words[value].lower().replace('_', '-')})"

    def _answers_to(self, node: int, number: int) -> tuple[ReplyKind | int, ...]:
        device = self._device(node)
        return _SPECIAL.get((device, self._name(node, number)), (number,))

    def _note_request(self, key: _Key, utc_ns: int) -> list[DecodedLine]:
        """Register a request; return lines for an expired one that it replaces."""
        self.tally.questions += 1
        request_times = self._open.get(key)
        if request_times is not None and utc_ns - request_times[-1] <= REPLY_LIMIT_NS:
            request_times.append(utc_ns)
            return []
        replaced = self._drop(key)
        self._open[key] = [utc_ns]
        return replaced

    def _match_reply(self, key: _Key, utc_ns: int) -> str:
        request_times = self._open.get(key)
        if request_times is None:
            self.tally.unsolicited += 1
            return ", UNASKED"
        delay_ns = utc_ns - request_times.pop(0)
        if not request_times:
            del self._open[key]
        self.tally.answers += 1
        self.tally.slowest_ns = max(self.tally.slowest_ns, delay_ns)
        is_late = delay_ns > REPLY_LIMIT_NS
        self.tally.late += is_late
        return f", {'LATE: ' if is_late else ''}{delay_ns // 1000} us after the request"

    def _expire(self, before_ns: int) -> list[DecodedLine]:
        """Drop the requests sent until `before_ns` and return their lines."""
        dropped: list[DecodedLine] = []
        while self._open:
            key = next(iter(self._open))
            if self._open[key][0] > before_ns:
                break
            dropped += self._drop(key)
        return dropped

    def _drop(self, key: _Key) -> list[DecodedLine]:
        node, kind = key
        if isinstance(kind, ReplyKind):
            name = kind.name.lower().replace("_", " ")
        else:
            name = self._name(node, kind)
        what = f"{node_name(node)}: {name}"
        request_times = self._open.pop(key, [])
        if request_times:
            self.tally.unanswered[what] += len(request_times)
        return [DecodedLine(t, f"UNANSWERED {what}") for t in request_times]


def _describe(answer: ReplyKind, data: bytes) -> str:
    if answer is ReplyKind.POSITION:
        encoder = decode_joint_encoder(data)
        extra = "" if encoder is None else f", joint encoder {encoder}"
        return f"is at {decode_position(data)}{extra}"
    if answer is ReplyKind.JOINT_ENCODER:
        return f"joint encoder at {decode_position(data)}"
    if answer is ReplyKind.TORQUE:
        torque, status = decode_torque(data)
        extra = f", status {status:08b}" if status else ""
        return f"measures the torque {_triple(torque)} N m{extra}"
    if answer is ReplyKind.FORCE:
        return f"measures the force {_triple(decode_force(data))} N"
    return f"measures the acceleration {_triple(decode_acceleration(data))} m/s2"


def _triple(values: tuple[float, float, float]) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
