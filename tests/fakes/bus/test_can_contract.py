"""One contract for every bus that reaches the simulated pucks."""

import can
import pytest

from fakes.pucks.options import NetworkOptions
from tests.fakes.buses import BUSES, FIRMWARE
from wam.bus.frames import encode_get, encode_set, encode_torques
from wam.bus.properties import Device, property_number

MS = 1_000_000
SAFETY = {10: [(0x546, "85 00 02 00")]}
WRENCH = [(0x50A, "00 00 00 00 00 00"), (0x50B, "00 00 00 00 00 00")]


@pytest.fixture(params=FIRMWARE)
def vers(request):
    return request.param


@pytest.fixture(params=BUSES)
def arm(request, tmp_path, vers):
    """Return a function that makes an arm behind the bus under test."""
    made = []

    def make(**options):
        network = NetworkOptions(vers=(vers,) * 7, **options)
        made.append(request.param(network, tmp_path))
        return made[-1]

    yield make
    for rig in made:
        rig.close()


def say(arm, can_id, data, wait_ns=MS):
    """Send a frame; return the frames that arrive within `wait_ns`."""
    message = can.Message(arbitration_id=can_id, is_extended_id=False, data=data)
    arm.bus.send(message)
    arm.rest(wait_ns)
    heard = []
    while (frame := arm.bus.recv(0)) is not None:
        heard.append((frame.arbitration_id, bytes(frame.data).hex(" ")))
    return heard


def asleep(nodes):
    return {n: [(0x406 + 0x20 * n, "85 00 00 00")] for n in nodes}


@pytest.mark.parametrize("has_sensor", [False, True])
def test_enumeration_finds_exactly_the_present_devices(arm, has_sensor):
    sleeping = arm(are_asleep=True, is_zeroed=False, has_sensor=has_sensor)
    found = {node: say(sleeping, node, b"\x05") for node in range(1, 32)}
    expected = asleep(range(1, 9 if has_sensor else 8)) | SAFETY
    assert {n: heard for n, heard in found.items() if heard} == expected


def test_a_woken_puck_reports_its_own_firmware(arm, vers):
    sleeping = arm(are_asleep=True, is_zeroed=False, boot_ns=20 * MS)
    assert say(sleeping, 7, encode_set(5, 2), 30 * MS) == []
    assert say(sleeping, 7, b"\x05") == [(0x4E6, "85 00 02 00")]
    assert say(sleeping, 7, b"\x00") == [(0x4E6, f"80 00 {vers:02x} 00")]


def test_a_woken_sensor_answers_with_force_and_torque(arm):
    sleeping = arm(are_asleep=True, has_sensor=True, boot_ns=20 * MS)
    assert say(sleeping, 8, b"\x36") == []
    assert say(sleeping, 8, encode_set(5, 2), 30 * MS) == []
    assert say(sleeping, 8, b"\x36") == WRENCH


def test_a_tare_is_not_answered(arm):
    assert say(arm(has_sensor=True), 8, b"\xb6\0\0\0\0\0") == []


def test_a_get_has_one_reply_and_a_set_none(arm, vers):
    rig = arm()
    number = property_number(Device.MOTOR, "MT", vers)
    assert say(rig, 3, encode_set(number, 1234)) == []
    assert say(rig, 3, encode_get(number)) == [(0x466, f"{0x80 | number:02x} 00 d2 04")]


@pytest.mark.parametrize("has_sensor", [False, True])
def test_the_arm_reports_its_positions_in_node_order_and_then_the_wrench(
    arm, vers, has_sensor
):
    rig = arm(has_sensor=has_sensor)
    request = encode_get(property_number(Device.MOTOR, "P", vers))
    rig.bus.send(can.Message(arbitration_id=8, is_extended_id=False, data=b"\x36"))
    heard = say(rig, 0x404, request)
    positions = ["00 00 00", "3f 70 1f", "00 8f e0", "3f 70 88", *["00 00 00"] * 3]
    assert sorted(heard) == [
        *((0x403 + 0x20 * n, data) for n, data in enumerate(positions, 1)),
        *(WRENCH if has_sensor else []),
    ]
    assert [i for i, _ in heard if i < 0x500] == [0x403 + 0x20 * n for n in range(1, 8)]


def test_torque_frames_move_an_active_arm_without_a_reply(arm, vers):
    rig = arm()
    number = property_number(Device.MOTOR, "T", vers)
    rig.press("activate")
    assert say(rig, 0x401, encode_torques([1, -2, 3, -4], number)) == [
        (0x540, "88 00 02 00")
    ]
    assert say(rig, 0x402, encode_torques([5, -6, 7], number)) == []
    assert rig.motors.units == [1, -2, 3, -4, 5, -6, 7]


def test_torque_frames_leave_an_idle_arm_alone(arm):
    rig = arm()
    assert say(rig, 0x401, encode_torques([1, -2, 3, -4])) == []
    assert rig.motors.units == [0] * 7


def test_in_e_stop_only_the_safety_module_is_on_the_bus(arm):
    rig = arm(has_sensor=True)
    rig.press("estop")
    say(rig, 1, b"\x05")  # fetches the broadcast as well
    assert [say(rig, node, b"\x05") for node in range(1, 9)] == [[]] * 8
    assert say(rig, 10, b"\x08") == [(0x546, "88 00 00 00")]


def test_power_returns_pucks_and_sensor_asleep(arm):
    rig = arm(has_sensor=True)
    rig.press("estop")
    rig.press("idle")
    say(rig, 9, b"\x05")  # fetches the broadcasts; node 9 is absent
    found = {node: say(rig, node, b"\x05") for node in range(1, 9)}
    assert found == asleep(range(1, 9))
