"""A strict host accepts the simulated network and detects every deviation."""

from collections import deque
from contextlib import closing

import can
import pytest

from fakes.pucks.options import NetworkOptions
from tests.fakes.buses import BUSES, FIRMWARE, InProcess
from tests.fakes.strict_client import DeviationError, StrictClient

MS = 1_000_000


def switched_on(vers, *, has_sensor):
    """Return an arm whose E-stop was just released."""
    return NetworkOptions(
        vers=(vers,) * 7, are_asleep=True, is_zeroed=False, has_sensor=has_sensor
    )


def drive(client, press, cycles):
    client.start()
    press("activate")
    client.expect_active()
    client.run(cycles)
    client.read_temperatures()
    if client.has_sensor:
        client.tare()
    client.run(cycles)
    client.finish()


@pytest.mark.parametrize("vers", FIRMWARE)
@pytest.mark.parametrize("kind", BUSES)
@pytest.mark.parametrize("has_sensor", [True, False])
def test_a_strict_host_drives_the_arm(kind, vers, has_sensor, tmp_path):
    with closing(kind(switched_on(vers, has_sensor=has_sensor), tmp_path)) as arm:
        client = StrictClient(arm.bus, arm.rest, has_sensor=has_sensor)
        drive(client, arm.press, cycles=150)
    assert client.vers == vers


class LyingBus:
    """Passes on the frames, none or several, that `lie` makes of each frame.

    Frames in `held` arrive with those after the next request.
    """

    def __init__(self, bus, lie):
        self._bus, self._lie = bus, lie
        self._ready = deque()
        self.held = deque()

    def send(self, frame):
        self._ready.extend(self.held)
        self.held.clear()
        self._bus.send(frame)
        self._ready.extend(self._lie(self, frame, is_of_host=True))

    def recv(self, timeout):
        while (frame := self._bus.recv(timeout)) is not None:
            self._ready.extend(self._lie(self, frame, is_of_host=False))
        return self._ready.popleft() if self._ready else None


def frame_of(can_id, data):
    return can.Message(
        arbitration_id=can_id, is_extended_id=False, data=bytes.fromhex(data)
    )


def changed(can_id, change, at=None):
    """Return a lie that changes frames of `can_id` that begin with `at`."""

    def lie(_bus, frame, is_of_host):
        if is_of_host:
            return []
        data = bytes(frame.data)
        if frame.arbitration_id == can_id and data[:1] == (at or data[:1]):
            return [frame_of(can_id, reply.hex()) for reply in change(data)]
        return [frame]

    return lie


def set_answered(_bus, frame, is_of_host):
    """Let puck 3 reply to a SET."""
    if is_of_host and frame.arbitration_id == 3 and len(frame.data) == 6:
        return [frame_of(0x466, "85 00 02 00")]
    return [] if is_of_host else [frame]


def late(can_id):
    """Return a lie that delays frames of `can_id` beyond a millisecond."""

    def lie(bus, frame, is_of_host):
        if not is_of_host and frame.arbitration_id == can_id:
            bus.held.append(frame)
            return []
        return [] if is_of_host else [frame]

    return lie


def unasked(_bus, frame, is_of_host):
    """Let puck 5 send an unsolicited reply when torques are sent."""
    if is_of_host and frame.arbitration_id == 0x401:
        return [frame_of(0x4A6, "89 00 23 00")]
    return [] if is_of_host else [frame]


def bit_flipped(index, mask):
    def change(data):
        damaged = bytearray(data)
        damaged[index] ^= mask
        return [bytes(damaged)]

    return change


LIES = {
    "doubled": (changed(0x466, lambda d: [d, d]), "doubled: 466"),
    "doubled position": (changed(0x4C3, lambda d: [d, d]), "doubled: 4c3"),
    "reply to a SET": (set_answered, "unsolicited: 466"),
    "late": (late(0x443), "no reply within 1 ms: 443"),
    "late STAT": (late(0x446), "unsolicited: 446"),
    "missing": (changed(0x50B, lambda _: []), "no reply within 1 ms: 50b"),
    "unsolicited": (unasked, "unsolicited: 4a6"),
    "STAT 1": (changed(0x4E6, bit_flipped(2, 1), b"\x85"), "STAT 1 of node 7"),
    "two-hot PEN": (changed(0x546, bit_flipped(2, 2), b"\xab"), "not one-hot"),
    "no-hot PEN": (changed(0x546, bit_flipped(2, 1), b"\xab"), "not one-hot"),
    "byte 1": (changed(0x486, bit_flipped(1, 1)), "byte 1 set"),
    "property": (changed(0x486, bit_flipped(0, 2)), "is not property"),
    "short": (changed(0x546, lambda d: [d[:4]], b"\xab"), "has not 6 bytes"),
    "long": (changed(0x426, lambda d: [d + b"\0\0"], b"\x81"), "has not 4 bytes"),
    "spare bits": (changed(0x4A3, bit_flipped(0, 0x40)), "spare bits"),
    "position of 4": (changed(0x4A3, lambda d: [d + b"\0"]), "is no position"),
    "idle status": (changed(0x50B, lambda d: [d + b"\0"]), "without a report"),
    "long force": (changed(0x50A, lambda d: [d + b"\x80"]), "force has 6 bytes"),
    "role": (changed(0x506, bit_flipped(2, 4), b"\x81"), "ROLE 0x0002 of node 8"),
}


@pytest.fixture
def arm(tmp_path):
    with closing(InProcess(switched_on(200, has_sensor=True), tmp_path)) as arm:
        yield arm


@pytest.mark.parametrize("name", LIES)
def test_a_strict_host_detects_a_wrong_network(name, arm):
    lie, words = LIES[name]
    client = StrictClient(LyingBus(arm.bus, lie), arm.rest, has_sensor=True)
    with pytest.raises(DeviationError, match=words):
        drive(client, arm.press, cycles=2)


def test_a_truthful_bus_is_accepted(arm):
    bus = LyingBus(arm.bus, lambda _, frame, is_of_host: [] if is_of_host else [frame])
    client = StrictClient(bus, arm.rest, has_sensor=True)
    drive(client, arm.press, cycles=2)
    assert client.vers == 200


def test_an_undeclared_sensor_is_a_deviation(arm):
    with pytest.raises(DeviationError, match="found nodes"):
        StrictClient(arm.bus, arm.rest, has_sensor=False).start()
