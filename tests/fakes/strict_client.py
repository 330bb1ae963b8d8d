"""A host of a WAM that follows the protocol's description and accepts no deviation.

It shares no code with the project, so that an error in the common codec shows.
"""

from collections.abc import Callable, Iterable
from math import cos, floor, pi, sin

import can

MS = 1_000_000
SENSOR, SAFETY = 8, 10
PUCKS = range(1, 8)
WHOLE_ARM, LOWER, WRIST = 0x404, 0x401, 0x402
BROADCAST = 0x540  # the safety module's, at any time
FORCE, TORQUE = 0x50A, 0x50B
HOME = (0, -36833, 36832, -36728, 0, 0, 0)

VERS, ROLE, STAT, MODE, TEMP, THERM = 0, 1, 5, 8, 9, 20
SAVE, LOAD, DEF = 30, 31, 32
T, P, CTS, IPNM, POLES = 42, 48, 68, 86, 90
ZERO, PEN, VL1, VL2, TL1, TL2, IFAULT = 42, 43, 45, 46, 47, 48, 55
SG1, FT, T1 = 42, 54, 61
LIMITS = {VL1: 0x1599, VL2: 0x1800, TL1: 0x1C7A, TL2: 0x1FA4}
ENCODER_LIMITS = ((132, (101, 102)), (125, (100, 101)), (65, (96, 97)))
IDLE, ACTIVE = 1, 2
TYPES = dict.fromkeys(PUCKS, 0) | {SAFETY: 2, SENSOR: 6}


CYCLE = 0.002  # s
# From joint angles to motor angles: gears 42, 28.25, 18, 9.7 and 14.93,
# with a differential of 1.68 in the shoulder and of 1 in the wrist.
HOME_Q = (0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0)
SHOULDER, ELBOW, UPPER, WRIST_GEAR, FLANGE = 42.0, 18.0, 28.25, 9.7, 14.93
LATERAL = UPPER / 1.68
UNITS = (2700, 2700, 2700, 2700, 6500, 6500, 17474)  # per N m at the motor
# The arm alone: twists of the joints' axes [rad], first moments of the links [kg m].
TWISTS = (-pi / 2, pi / 2, -pi / 2, pi / 2, -pi / 2, pi / 2, 0.0)
MOMENTS = (
    (-0.047700911, 1.312474953, -0.007106682),
    (-0.009183513, 0.120354394, 0.059750958),
    (0.147771229, -2.274893057, 0.000054069),
    (-0.123600041, 0.000148219, 0.259148511),
    (0.000019550, -0.242068292, 0.000529462),
    (-0.000024234, -0.006898922, 0.009897766),
    (0.000011199, 0.000005474, 0.004343890),
)
FALL = (0.0, 0.0, -9.81)
# Joint gains of the vendor's library [N m/rad], [N m s/rad].
KP = (900.0, 2500.0, 600.0, 500.0, 50.0, 50.0, 8.0)
KD = (10.0, 20.0, 5.0, 2.0, 0.5, 0.5, 0.05)
LARGEST_UNITS = 4700  # below the module's warning
POLE = 0.265  # of the velocity filter: share of a new difference

Vector = tuple[float, float, float]


def joints(counts: Iterable[int]) -> list[float]:
    """Return joint angles [rad] of motor positions."""
    m = [2 * pi * count / 4096 for count in counts]
    return [
        -m[0] / SHOULDER,
        (m[1] - m[2]) / (2 * UPPER),
        -(m[1] + m[2]) / (2 * LATERAL),
        -m[3] / ELBOW,
        (m[4] + m[5]) / (2 * WRIST_GEAR),
        (m[5] - m[4]) / (2 * WRIST_GEAR),
        -m[6] / FLANGE,
    ]


def motor_units(tau: list[float]) -> list[int]:
    """Return puck units of joint torques [N m]; power is kept."""
    motors = (
        -tau[0] / SHOULDER,
        tau[1] / (2 * UPPER) - tau[2] / (2 * LATERAL),
        -tau[1] / (2 * UPPER) - tau[2] / (2 * LATERAL),
        -tau[3] / ELBOW,
        (tau[4] - tau[5]) / (2 * WRIST_GEAR),
        (tau[4] + tau[5]) / (2 * WRIST_GEAR),
        -tau[6] / FLANGE,
    )
    units = [floor(u * per) for u, per in zip(motors, UNITS, strict=True)]
    return [max(-LARGEST_UNITS, min(LARGEST_UNITS, u)) for u in units]


def packed(units: list[int]) -> bytes:
    """Return a torque frame: four times 14 bits after the property."""
    word = 0
    for value in [*units, 0][:4]:
        word = word << 14 | value & 0x3FFF
    return bytes((0x80 | T,)) + word.to_bytes(7, "big")


def turned(matrix: list[Vector], v: Vector) -> Vector:
    x, y, z = (sum(a * b for a, b in zip(row, v, strict=True)) for row in matrix)
    return x, y, z


def transposed(matrix: list[Vector]) -> list[Vector]:
    return [(a, b, c) for a, b, c in zip(*matrix, strict=True)]


def cross(a: Vector, b: Vector) -> Vector:
    (ax, ay, az), (bx, by, bz) = a, b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def holding_torques(q: list[float]) -> list[float]:
    """Return the joint torques [N m] that carry the links of the arm alone at `q`."""
    turns: list[list[Vector]] = []
    for angle, twist in zip(q, TWISTS, strict=True):
        c, s, ca, sa = cos(angle), sin(angle), cos(twist), sin(twist)
        turns.append([(c, -s * ca, s * sa), (s, c * ca, -c * sa), (0.0, sa, ca)])
    falls, fall = [], FALL
    for turn in turns:
        fall = turned(transposed(turn), fall)
        falls.append(fall)
    torque, torques = (0.0, 0.0, 0.0), []
    for turn, fall, moment in reversed(list(zip(turns, falls, MOMENTS, strict=True))):
        x, y, z = cross(fall, moment)
        torque = turned(turn, (x + torque[0], y + torque[1], z + torque[2]))
        torques.insert(0, torque[2])
    return torques


class DeviationError(Exception):
    """The network did something that the description does not allow."""


def require(is_met: bool, what: str) -> None:
    if not is_met:
        raise DeviationError(what)


def reply_id(node: int) -> int:
    return 0x406 + 0x20 * node


def position_id(node: int) -> int:
    return 0x403 + 0x20 * node


class StrictClient:
    """Drives an arm and raises DeviationError at the first deviation.

    `rest(duration_ns)` lets time pass. A reply later than 1 ms counts as missing.
    """

    def __init__(
        self, bus: can.BusABC, rest: Callable[[int], None], *, has_sensor: bool
    ) -> None:
        self.has_sensor = has_sensor
        self.vers = 0
        self._bus = bus
        self._rest = rest

    def start(self) -> None:
        """Find, wake, read and zero an idle arm that was just switched on."""
        self._enumerate()
        self._restore_limits()
        require(self._get(SAFETY, MODE) == IDLE, "the safety module is not idle")
        require(self._get(SAFETY, ZERO) == 0, "positions are known though just woken")
        self._wake_all()
        for node in PUCKS:
            self._identify(node)
        self._set(WHOLE_ARM, MODE, 0)
        self._zero()
        self._set_limits()
        self._check_pendant()

    def expect_active(self) -> None:
        """Check that the pendant's button has reached every device."""
        require(self._get(SAFETY, MODE) == ACTIVE, "not active")
        replies = self._ask(WHOLE_ARM, MODE, map(reply_id, PUCKS))
        modes = {self._value(data, MODE, 4) for data in replies.values()}
        require(modes == {2}, f"pucks in modes {modes} while active")
        self._check_pendant()

    def run(self, cycles: int) -> None:
        """Request positions and wrench and send torques, 500 times a second."""
        for _ in range(cycles):
            expected = {position_id(node) for node in PUCKS}
            self._send(WHOLE_ARM, bytes((P,)))
            if self.has_sensor:
                self._send(SENSOR, bytes((FT,)))
                expected |= {FORCE, TORQUE}
            self._check_cycle(self._hear(expected))
            for group in (LOWER, WRIST):
                self._send(group, bytes((0x80 | T, *bytes(7))))
            self._hear(())

    def read_joints(self) -> list[float]:
        """Return the joint angles [rad] now."""
        self._send(WHOLE_ARM, bytes((P,)))
        heard = self._hear({position_id(node) for node in PUCKS})
        return joints(self._position(heard[position_id(node)]) for node in PUCKS)

    def move(self, offsets: tuple[float, ...], seconds: float) -> list[float]:
        """Turn the joints from home by `offsets` [rad]; return their angles then.

        Gravity of the bare arm and a PD in each joint, along a straight line that
        begins and ends at rest and takes four fifths of the time.
        """
        q = list(HOME_Q)
        speed = [0.0] * 7
        cycles = round(seconds / CYCLE)
        for cycle in range(cycles):
            before, q = q, self.read_joints()
            steps = zip(before, q, speed, strict=True)
            speed = [v + POLE * ((b - a) / CYCLE - v) for a, b, v in steps]
            s = min(1.25 * (cycle + 1) / cycles, 1.0)
            share = s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
            wanted = [a + share * d for a, d in zip(HOME_Q, offsets, strict=True)]
            state = zip(holding_torques(q), KP, KD, wanted, q, speed, strict=True)
            tau = [g + kp * (w - a) - kd * v for g, kp, kd, w, a, v in state]
            units = motor_units(tau)
            self._send(LOWER, packed(units[:4]))
            self._send(WRIST, packed(units[4:]))
            self._hear(())
        return self.read_joints()

    def tare(self) -> None:
        """Zero the sensor; the reading after it may be the old one."""
        self._set(SENSOR, FT, 0)
        for _ in range(2):
            self._send(SENSOR, bytes((FT,)))
            self._check_wrench(self._hear((FORCE, TORQUE)))

    def read_temperatures(self) -> None:
        """Request the temperatures of every puck and of the sensor."""
        for node in PUCKS:
            degc = (self._get(node, TEMP), self._get(node, THERM))
            require(all(-40 < t < 120 for t in degc), f"puck {node} at {degc} degc")
        if self.has_sensor:
            for number in (TEMP, T1, T1 + 1, T1 + 2, SG1):
                self._get(SENSOR, number)

    def finish(self) -> None:
        """Idle the arm and check that it is idle."""
        self._set(SAFETY, MODE, IDLE)
        require(self._get(SAFETY, MODE) == IDLE, "not idle though asked for")
        self.run(1)
        self._check_pendant()
        for node in self._nodes():
            require(self._stat(node) == 2, f"node {node} fell asleep")

    def _nodes(self) -> list[int]:
        return [*PUCKS, *([SENSOR] if self.has_sensor else [])]

    def _enumerate(self) -> None:
        found = [node for node in range(1, 32) if self._try_stat(node) is not None]
        require(found == [*self._nodes(), SAFETY], f"found nodes {found}")
        for node in found:
            role = self._get(node, ROLE)
            require(role & 0x1F == TYPES[node], f"ROLE {role:#06x} of node {node}")
            self._get(node, VERS)
            require(self._stat(node) == 2 * (node == SAFETY), "a puck is not asleep")

    def _restore_limits(self) -> None:
        for number in LIMITS:
            for action in (DEF, LOAD):
                self._set(SAFETY, action, number)
            require(self._stat(SAFETY) == 2, "the safety module is not ready")
            self._hear((), 10 * MS)

    def _wake_all(self) -> None:
        for node in self._nodes():
            self._set(node, STAT, 2)
            self._hear((), 10 * MS)
        self._hear((), 1000 * MS)
        for node in self._nodes():
            require(self._stat(node) == 2, f"node {node} did not wake up")

    def _identify(self, node: int) -> None:
        vers = self._get(node, VERS)
        require(self.vers in (0, vers), "pucks of several firmwares")
        self.vers = vers
        require(self._get(node, CTS, 6) > 0, f"CTS of puck {node}")
        require(self._get(node, IPNM) > 0, f"IPNM of puck {node}")
        poles = self._get(node, POLES)
        require(node != 7 or poles == 6, f"{poles} poles on a wrist")
        for number in next(pair for first, pair in ENCODER_LIMITS if vers >= first):
            require(self._get(node, number) == 0, "a joint encoder nobody told of")

    def _zero(self) -> None:
        self._set(SAFETY, IFAULT, 5)
        for node, counts in zip(PUCKS, HOME, strict=True):
            self._set(node, P, counts)
        self._send(WHOLE_ARM, bytes((P,)))
        heard = self._hear(map(position_id, PUCKS))
        found = tuple(self._position(heard[position_id(node)]) for node in PUCKS)
        require(found == HOME, f"at {found} though told {HOME}")
        self._set(SAFETY, ZERO, 1)
        require(self._get(SAFETY, ZERO) == 1, "not zeroed though told")
        self._set(SAFETY, IFAULT, 5)

    def _set_limits(self) -> None:
        for number, value in LIMITS.items():
            self._set(SAFETY, number, value)
            self._set(SAFETY, SAVE, number)
            self._hear((), 10 * MS)
        for number, value in LIMITS.items():
            found = self._get(SAFETY, number)
            require(found == value, f"limit {number} is {found}, told {value}")

    def _check_cycle(self, heard: dict[int, bytes]) -> None:
        for node in PUCKS:
            self._position(heard[position_id(node)])
        if self.has_sensor:
            self._check_wrench(heard)

    def _check_wrench(self, heard: dict[int, bytes]) -> None:
        require(len(heard[FORCE]) == 6, "a force has 6 bytes")
        torque = heard[TORQUE]
        require(len(torque) in (6, 7), "a torque has 6 or 7 bytes")
        require(len(torque) == 6 or torque[6] != 0, "a status without a report")

    def _check_pendant(self) -> None:
        data = self._ask(SAFETY, PEN, (reply_id(SAFETY),))[reply_id(SAFETY)]
        word = self._value(data, PEN, 6)
        fields = [word >> shift & 7 for shift in (0, 3, 6, 9, 12)]
        require(all(f in (1, 2, 4) for f in fields), f"PEN {word:08x} is not one-hot")

    def _try_stat(self, node: int) -> int | None:
        self._send(node, bytes((STAT,)))
        self._rest(MS)
        heard = self._collect({reply_id(node)})
        if not heard:
            return None
        return self._checked_stat(node, heard[reply_id(node)])

    def _stat(self, node: int) -> int:
        wanted = reply_id(node)
        return self._checked_stat(node, self._ask(node, STAT, (wanted,))[wanted])

    def _checked_stat(self, node: int, data: bytes) -> int:
        stat = self._value(data, STAT, 4)
        require(stat in (0, 2), f"STAT {stat} of node {node}")
        return stat

    def _get(self, node: int, number: int, length: int = 4) -> int:
        wanted = reply_id(node)
        return self._value(self._ask(node, number, (wanted,))[wanted], number, length)

    def _set(self, can_id: int, number: int, value: int) -> None:
        tail = value.to_bytes(4, "little", signed=True)
        self._send(can_id, bytes((0x80 | number, 0)) + tail)
        self._hear((), MS)

    def _ask(self, can_id: int, number: int, ids: Iterable[int]) -> dict[int, bytes]:
        self._send(can_id, bytes((number,)))
        return self._hear(ids)

    def _send(self, can_id: int, data: bytes) -> None:
        message = can.Message(arbitration_id=can_id, is_extended_id=False, data=data)
        self._bus.send(message)

    def _hear(self, ids: Iterable[int], within_ns: int = MS) -> dict[int, bytes]:
        """Return the replies of `ids`; each must reply once, and no other device."""
        wanted = set(ids)
        self._rest(within_ns)
        heard = self._collect(wanted)
        missing = [f"{can_id:03x}" for can_id in sorted(wanted - set(heard))]
        require(not missing, f"no reply within 1 ms: {' '.join(missing)}")
        return heard

    def _collect(self, wanted: set[int]) -> dict[int, bytes]:
        heard: dict[int, bytes] = {}
        while (frame := self._bus.recv(0)) is not None:
            require(not frame.is_extended_id, "an extended identifier")
            require(not (frame.is_remote_frame or frame.is_error_frame), "no data")
            can_id, data = frame.arbitration_id, bytes(frame.data)
            is_of_host = not can_id & 0x3E0
            if is_of_host or can_id == BROADCAST:
                continue
            text = f"{can_id:03x} {data.hex(' ')}"
            require(can_id in wanted, f"unsolicited: {text}")
            require(can_id not in heard, f"doubled: {text}")
            heard[can_id] = data
        return heard

    @staticmethod
    def _value(data: bytes, number: int, length: int) -> int:
        shown = data.hex(" ")
        require(len(data) == length, f"{shown} has not {length} bytes")
        require(data[0] == 0x80 | number, f"{shown} is not property {number}")
        require(data[1] == 0, f"{shown} has byte 1 set")
        return int.from_bytes(data[2:], "little", signed=True)

    @staticmethod
    def _position(data: bytes) -> int:
        shown = data.hex(" ")
        require(len(data) in (3, 6), f"{shown} is no position")
        require(data[0] < 0x40, f"{shown} has spare bits set")
        counts = int.from_bytes(data[:3], "big")
        return counts - (1 << 22) if counts >= 1 << 21 else counts
