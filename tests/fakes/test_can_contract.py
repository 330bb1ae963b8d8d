"""One contract for every bus that the simulated pucks are reached by."""

from itertools import count

import can
import pytest

from fakes.can_hub import SocketHub
from fakes.can_port import CanPort
from fakes.can_socket import SocketBus
from fakes.network_options import NetworkOptions
from fakes.pucks import PuckNetwork
from fakes.serve import PuckServer
from tests.fakes.stepped import Motors, Rig, SteppedClock
from wam.frames import encode_get, encode_set, encode_torques
from wam.pucks import Device, property_number

MS = 1_000_000
COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
FIRMWARE = (100, 128, 200)  # one of 65-124, of 125-131, of 132 and later
_channels = count()


class InProcess:
    def __init__(self, options, _folder):
        self._rig = Rig(options, COUNTS)
        self.motors, self.bus = self._rig.motors, self._rig.bus
        self.press, self.rest = self._rig.network.pendant, self._rig.rest

    def close(self):
        self.bus.shutdown()


class Served:
    """A server on stepped time: the kernel hands over what is sent at once."""

    def __init__(self, options, port):
        self.clock, self.motors = SteppedClock(), Motors(COUNTS)
        network = PuckNetwork(self.motors, options, self.clock.t_ns)
        self.server = PuckServer(network, self.motors, port, self.clock)
        self.press = self.server.press

    def rest(self, duration_ns):
        end_ns = self.clock.t_ns + duration_ns
        while self.clock.t_ns < end_ns:
            self.server.step()

    def close(self):
        self.bus.shutdown()
        self.server.close()


class OnSocket(Served):
    def __init__(self, options, folder):
        super().__init__(options, SocketHub(folder / "bus"))
        self.bus = SocketBus(str(folder / "bus"))


class OnVirtual(Served):
    def __init__(self, options, _folder):
        channel = f"contract-{next(_channels)}"
        super().__init__(options, CanPort("virtual", channel, 1_000_000))
        self.bus = can.Bus(interface="virtual", channel=channel)


@pytest.fixture(params=[InProcess, OnSocket, OnVirtual])
def arm(request, tmp_path):
    """Return a function that makes an arm behind the bus under test."""
    made = []

    def make(**options):
        made.append(request.param(NetworkOptions(**options), tmp_path))
        return made[-1]

    yield make
    for each in made:
        each.close()


def say(arm, can_id, data, wait_ns=2 * MS):
    """Send a frame; return what arrives while `wait_ns` pass."""
    message = can.Message(arbitration_id=can_id, is_extended_id=False, data=data)
    arm.bus.send(message)
    arm.rest(wait_ns)
    heard = []
    while (frame := arm.bus.recv(0)) is not None:
        heard.append((frame.arbitration_id, bytes(frame.data).hex(" ")))
    return heard


def test_enumeration_finds_the_pucks_and_the_safety_module_only(arm):
    sleeping = arm(are_asleep=True, is_zeroed=False)
    found = {node: say(sleeping, node, b"\x05") for node in range(1, 32)}
    asleep = {n: [(0x406 + 0x20 * n, "85 00 00 00")] for n in range(1, 8)}
    safety = {10: [(0x546, "85 00 02 00")]}
    assert {n: heard for n, heard in found.items() if heard} == asleep | safety


def test_a_woken_puck_tells_its_own_firmware(arm):
    sleeping = arm(are_asleep=True, is_zeroed=False, boot_ns=20 * MS)
    assert say(sleeping, 7, encode_set(5, 2), 30 * MS) == []
    assert say(sleeping, 7, b"\x05") == [(0x4E6, "85 00 02 00")]
    assert say(sleeping, 7, b"\x00") == [(0x4E6, "80 00 c8 00")]


@pytest.mark.parametrize("vers", FIRMWARE)
def test_a_get_has_one_answer_and_a_set_none(arm, vers):
    one = arm(vers=(vers,) * 7)
    number = property_number(Device.MOTOR, "MT", vers)
    assert say(one, 3, encode_set(number, 1234)) == []
    assert say(one, 3, encode_get(number)) == [(0x466, f"{0x80 | number:02x} 00 d2 04")]


@pytest.mark.parametrize("vers", FIRMWARE)
def test_the_whole_arm_reports_its_positions_in_node_order(arm, vers):
    request = encode_get(property_number(Device.MOTOR, "P", vers))
    heard = say(arm(vers=(vers,) * 7), 0x404, request)
    assert [can_id for can_id, _ in heard] == [0x403 + 0x20 * n for n in range(1, 8)]
    assert [data for _, data in heard[:4]] == [
        "00 00 00",
        "3f 70 1f",
        "00 8f e0",
        "3f 70 88",
    ]


@pytest.mark.parametrize("vers", FIRMWARE)
def test_torque_frames_move_an_active_arm_without_an_answer(arm, vers):
    one = arm(vers=(vers,) * 7)
    number = property_number(Device.MOTOR, "T", vers)
    one.press("activate")
    assert say(one, 0x401, encode_torques([1, -2, 3, -4], number)) == [
        (0x540, "88 00 02 00")
    ]
    assert say(one, 0x402, encode_torques([5, -6, 7], number)) == []
    assert one.motors.units == [1, -2, 3, -4, 5, -6, 7]


def test_torque_frames_leave_an_idle_arm_alone(arm):
    one = arm()
    assert say(one, 0x401, encode_torques([1, -2, 3, -4])) == []
    assert one.motors.units == [0] * 7


def test_an_arm_in_e_stop_leaves_only_the_safety_module_on_the_bus(arm):
    one = arm()
    one.press("estop")
    say(one, 1, b"\x05")  # fetches the broadcast as well
    assert say(one, 1, b"\x05") == []
    assert say(one, 10, b"\x08") == [(0x546, "88 00 00 00")]
