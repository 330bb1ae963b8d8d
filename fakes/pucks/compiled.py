# pyright: basic
"""The wire of an arm at work, where frames of a usual cycle take the short way.

While the arm is ACTIVE and nothing is wrong, a cycle has two kinds of traffic: a
question for the positions of all motors, and torques for them. `CyclicWire` answers and
obeys those by compiled functions over one record, with what `WiredNetwork`, `PuckBank`
and `FakeSafetyModule` would make of them. Whatever else happens goes the long way.
"""

from collections.abc import Mapping, Sequence
from heapq import heappop
from struct import Struct

import numpy as np

from fakes.kernels.compiler import inline, kernel
from fakes.pucks.bank import LOWER
from fakes.pucks.event_queue import FRAME_NS, NEVER, OutFrame
from fakes.pucks.network import PuckNetwork
from fakes.pucks.speed_monitor import HISTORY, SpeedMonitor
from fakes.pucks.wire import WiredNetwork
from wam.bus.frames import (
    MOTOR_NODES,
    POSITION_MODULUS,
    TORQUE_SIGNS,
    Group,
    group_id,
    position_reply_id,
)
from wam.driver.safety_module import COUNTS_PER_SPEED

_SEVEN, _MONITORED = (7,), 4  # motors, and those that tell the speed of the arm
_ROOM = HISTORY + 1
_PUCKS = np.dtype(
    [
        ("counts", np.int64, _SEVEN),  # first: they are packed into the beginning
        ("offsets", np.int64, _SEVEN),
        ("slots", np.int64, _SEVEN),
        ("limits", np.int64, _SEVEN),
        ("torques", np.int64, _SEVEN),
        ("largest", np.int64, (2,)),  # torques commanded to lower arm and wrist
        ("largest_calm", np.int64),  # torque beyond which the safety module warns
        ("fastest_calm", float),  # count rate up to which nothing is too fast [1/ns]
        ("times_ns", np.int64, (_MONITORED, _ROOM)),
        ("seen", np.int64, (_MONITORED, _ROOM)),
        ("known", np.int64, (_MONITORED,)),
        ("replies", np.uint8, (21,)),
    ],
    align=True,
)
_COUNTS = Struct("7q")
_ARM_ID = group_id(Group.ARM)
_TORQUES = {group_id(Group.LOWER_TORQUE): 0, group_id(Group.WRIST_TORQUE): 1}
_REPLY_NS = FRAME_NS[3]
# Of the replies to one question: how long after the first begins each has come [ns],
# its identifier, and where its bytes are.
_REPLIES = [
    (n * _REPLY_NS, position_reply_id(n), 3 * n - 3, 3 * n) for n in MOTOR_NODES
]
_ALL_NS = _REPLIES[-1][0]
_HALF = POSITION_MODULUS // 2  # positions are signed


class CyclicWire(WiredNetwork):
    """A `WiredNetwork` on which a usual cycle takes the short way.

    Attributes:
        shortened: how often something took it.
    """

    def __init__(self, network: PuckNetwork) -> None:
        """Take over a network, and where it keeps torques and positions heard."""
        super().__init__(network)
        self._bytes = bytearray(_PUCKS.itemsize)
        self._pucks = pucks = np.frombuffer(self._bytes, _PUCKS)
        self._torques, self._replies = pucks["torques"][0], pucks["replies"][0]
        self._bank, self._safety, self._motors = network.parts
        self._bank.share_torques(self._torques)
        largest = pucks["largest"][0]
        largest[:] = self._safety.largest
        self._safety.largest = largest
        self._safety.speeds = monitor = RecordedSpeeds(network.options.cts, pucks)
        self._per_rate = monitor.limit_per_rate
        self.shortened = 0
        self._known_at = -1  # touches of the network at which `_learn` looked
        self._latch_ns = network.options.latch_ns
        self._heartbeat_ns, self._header, self._question = 0, 0, b""
        _compile(pucks.copy())

    def advance(self, t_ns: int) -> list[OutFrame]:
        """Let wire and network go on to `t_ns`; return the devices' frames till then.

        Each comes with the time [ns] at which it was sent.
        """
        schedule = self._schedule
        if schedule.next_ns > t_ns and not schedule.outbox:
            if t_ns < self._next_ns:
                return super().advance(t_ns)  # nothing happens
            is_known = self._known_at == self.network.touches
            if (is_known and not schedule.is_intercepted) or self._learn():
                sent = self._go_short(t_ns)
                if sent is not None:
                    self.shortened += 1
                    schedule.now_ns = t_ns
                    return sent
        self._known_at = -1
        return super().advance(t_ns)

    def _learn(self) -> bool:
        """Look whether the arm is at work and nothing is wrong."""
        limits = self._safety.calm_limits
        driven = None if limits is None else self._bank.driven_pucks()
        if limits is None or driven is None or self._schedule.is_intercepted:
            return False
        largest, fastest, self._heartbeat_ns = limits
        pucks = self._pucks
        pucks["largest_calm"] = largest
        pucks["fastest_calm"] = 0.999999 * fastest / self._per_rate
        pucks["offsets"] = [puck.offset for puck in driven]
        pucks["slots"] = [puck.slot for puck in driven]
        pucks["limits"] = [puck.limit for puck in driven]
        self._header = driven[0].t_header
        self._question = bytes((driven[0].p_number,))
        self._known_at = self.network.touches
        return True

    def _go_short(self, t_ns: int) -> list[OutFrame] | None:
        """Go on to `t_ns` with the frames that wait, None if one is no usual one."""
        if self._on_wire is None:
            return None
        can_id, _, data, is_of_host = self._on_wire
        if can_id != _ARM_ID:
            return [] if self._obey(t_ns) else None
        if data == self._question and is_of_host and not self._waiting:
            return self._answer(t_ns)
        return None

    def _answer(self, t_ns: int) -> list[OutFrame] | None:
        """Let all motors tell their positions, if that can end in time."""
        latched_ns = self._next_ns + self._latch_ns
        last_ns = latched_ns + _ALL_NS
        if last_ns > t_ns:
            return None
        self._motors.advance(latched_ns)
        _COUNTS.pack_into(self._bytes, 0, *self._motors.counts())
        if not _latch(self._pucks, latched_ns):
            return None
        self._schedule.set_alarm(latched_ns + self._heartbeat_ns)
        self._on_wire, self._next_ns, self._free_ns = None, NEVER, last_ns
        data = self._replies.tobytes()
        return [
            (latched_ns + after_ns, can_id, data[begin:end])
            for after_ns, can_id, begin, end in _REPLIES
        ]

    def _obey(self, t_ns: int) -> bool:
        """Let the motors follow torque frames, one by one, until another kind comes."""
        motors = self._motors
        while (frame := self._on_wire) is not None and self._next_ns <= t_ns:
            can_id, _, data, is_of_host = frame
            part = _TORQUES.get(can_id)
            is_usual = is_of_host and len(data) == 8 and data[0] == self._header
            if part is None or not is_usual:
                return False
            motors.advance(self._next_ns)
            if not _take(self._pucks, part, int.from_bytes(data[1:], "big")):
                return False
            motors.set_torques(self._torques.tolist())
            self._end_frame()
        return self._on_wire is None and not self._waiting

    def _end_frame(self) -> None:
        """Let the next frame have the wire, if there is one."""
        self._free_ns = free_ns = self._next_ns
        if self._waiting:
            self._on_wire = following = heappop(self._waiting)
            self._next_ns = free_ns + FRAME_NS[len(following[2])]
        else:
            self._on_wire, self._next_ns = None, NEVER


class RecordedSpeeds(SpeedMonitor):
    """A `SpeedMonitor` whose history is in the record.

    Attributes:
        limit_per_rate: units of VL1 and VL2 of one count per nanosecond.
    """

    def __init__(self, cts: Sequence[int], pucks: np.ndarray) -> None:
        """Take constants of the motors [counts per turn] and where to remember."""
        self._pucks, self._record = pucks, pucks[0]
        super().__init__(cts)
        self.limit_per_rate = 1e9 * self._per_rate * COUNTS_PER_SPEED

    def reset(self) -> None:
        """Begin anew: the pucks have lost their power."""
        self._record["known"] = 0

    @property
    def _seen(self) -> list[list[tuple[int, int]]]:
        record = self._record
        rows = zip(record["times_ns"].tolist(), record["seen"].tolist(), strict=True)
        pairs = [list(zip(*row, strict=True)) for row in rows]
        return [row[:n] for row, n in zip(pairs, record["known"].tolist(), strict=True)]

    def on_positions(self, t_ns: int, positions: Mapping[int, int]) -> None:
        """Take positions [counts] by node, all latched at `t_ns`."""
        for i in range(_MONITORED):
            if i + 1 in positions:
                _note(self._pucks, i, t_ns, positions[i + 1])


def _compile(pucks: np.ndarray) -> None:
    """Have the machine code before it is needed; `pucks` is nobody's."""
    _latch(pucks, 0)
    _note(pucks, 0, 0, 0)
    _take(pucks, 0, 0)


@kernel
def _latch(pucks, t_ns):
    """Fill `replies` with the positions at `t_ns`; do nothing if that is too fast.

    Return whether it was done.
    """
    p = pucks[0]
    for i in range(_MONITORED):
        n = p.known[i]
        if n == 0:
            continue
        if t_ns <= p.times_ns[i, n - 1]:
            return False
        first = 1 if n == _ROOM else 0  # the oldest one will be forgotten
        moved = _wrapped(p, i) - p.seen[i, first]
        if abs(moved) > p.fastest_calm * (t_ns - p.times_ns[i, first]):
            return False
    for i in range(_MONITORED):
        _remember(p, i, t_ns, _wrapped(p, i))
    for i in range(7):
        position = (p.counts[i] + p.offsets[i]) % POSITION_MODULUS
        for k in range(3):
            p.replies[3 * i + k] = position >> (16 - 8 * k) & 0xFF
    return True


@inline
def _wrapped(p, i):
    """Return a position as the wire carries it, signed [counts]."""
    return (p.counts[i] + p.offsets[i] + _HALF) % POSITION_MODULUS - _HALF


@kernel
def _note(pucks, i, t_ns, counts):
    p = pucks[0]
    n = p.known[i]
    if n == 0 or t_ns > p.times_ns[i, n - 1]:
        _remember(p, i, t_ns, counts)


@inline
def _remember(p, i, t_ns, counts):
    n = p.known[i]
    if n == _ROOM:
        n -= 1
        for k in range(n):
            p.times_ns[i, k], p.seen[i, k] = p.times_ns[i, k + 1], p.seen[i, k + 1]
    p.times_ns[i, n], p.seen[i, n] = t_ns, counts
    p.known[i] = n + 1


@kernel
def _take(pucks, part, word):
    """Take the torques of `part` of the arm; do nothing if one is to be warned of.

    Return whether it was done.
    """
    p = pucks[0]
    word ^= TORQUE_SIGNS
    largest = 0
    for k in range(4):
        largest = max(largest, abs(_torque(word, k)))
    if max(largest, p.largest[1 - part]) > p.largest_calm:
        return False
    p.largest[part] = largest
    for i in range(LOWER * part, 7 if part else LOWER):
        units, limit = _torque(word, p.slots[i]), p.limits[i]
        p.torques[i] = limit if units > limit else -limit if units < -limit else units
    return True


@inline
def _torque(word, k):
    """Return torque number `k` of a frame's last seven bytes [puck units]."""
    return (word >> (42 - 14 * k) & 0x3FFF) - 0x2000
