"""Error frames of Linux CAN drivers give named errors, counts and a bus condition."""

import pytest

from acquisition.devices import BusCondition
from wam.bus.error_frames import BusErrors, error_names

FLAG = 0x20000000

# (identifier, data, reported errors): as seen from the kernel, and every class alone
FRAMES = [
    (0x20000040, "0000000000000000", {"bus-off"}),
    (0x20000204, "0004000000000061", {"warning"}),
    (0x20000204, "0008000000006100", {"warning"}),
    (0x20000204, "0010000000000082", {"passive"}),
    (0x20000204, "0020000000008200", {"passive"}),
    (0x20000204, "0040000000000000", {"active"}),
    (0x200000A8, "0000001900000000", {"no-acknowledgement"}),
    (0x20000088, "0000001900000000", {"no-acknowledgement"}),
    (0x20000088, "0000001B00000000", {"no-acknowledgement"}),
    (0x2000008C, "0001000000000000", {"rx-overflow"}),
    (0x20000004, "0002000000000000", {"tx-overflow"}),
    (0x20000001, "0000000000000000", {"tx-timeout"}),
    (0x20000002, "0700000000000000", {"lost-arbitration"}),
    (0x20000088, "0000010000000000", {"bit"}),
    (0x20000088, "0000020A00000000", {"form"}),
    (0x20000088, "0000040000000000", {"stuff"}),
    (0x20000088, "0000080000000000", {"bit"}),
    (0x20000088, "0000100000000000", {"bit"}),
    (0x20000088, "0000200000000000", {"overload"}),
    (0x20000088, "0000000800000000", {"crc"}),
    (0x20000088, "0000041800000000", {"stuff", "crc"}),
    (0x20000010, "0000000004000000", {"transceiver"}),
    (0x20000100, "0000000000000000", {"restarted"}),
    (0x20000080, "0004000000000000", {"warning"}),
    (0x20000080, "0000000000000000", {"other"}),
    (0x20000200, "0000000000006161", {"other"}),
    (0x20000000, "", {"other"}),
    (0x20000020, "", {"no-acknowledgement"}),
]


@pytest.mark.parametrize(("can_id", "data", "names"), FRAMES)
@pytest.mark.parametrize("flag", [FLAG, 0])  # python-can removes the flag
def test_an_error_frame_is_described(can_id, data, names, flag):
    can_id = can_id & ~FLAG | flag
    assert error_names(can_id, bytes.fromhex(data)) == names


def test_any_identifier_and_bytes_give_a_description():
    for can_id in range(0x800):
        for byte in (0x00, 0x5A, 0xA5, 0xFF):
            assert error_names(can_id, bytes([byte] * 8))


def after(*frames):
    errors = BusErrors()
    for can_id, data in frames:
        errors.add(can_id, bytes.fromhex(data))
    return errors


OFF, RESTARTED = (0x040, ""), (0x100, "")
PASSIVE, ACTIVE = (0x204, "0020"), (0x204, "0040")
WARNING = (0x204, "0004")


@pytest.mark.parametrize(
    ("frames", "condition"),
    [
        ((), BusCondition.SOUND),
        ((WARNING,), BusCondition.SOUND),
        ((PASSIVE,), BusCondition.UNACKNOWLEDGED),
        (((0x088, "00000019"),), BusCondition.UNACKNOWLEDGED),
        ((PASSIVE, ACTIVE), BusCondition.SOUND),
        ((PASSIVE, OFF), BusCondition.OFF),
        ((OFF, PASSIVE), BusCondition.OFF),
        ((OFF, ACTIVE), BusCondition.OFF),  # it does not bring the carrier back
        ((OFF, RESTARTED), BusCondition.SOUND),
    ],
)
def test_bus_off_lasts_until_a_restart(frames, condition):
    assert after(*frames).condition is condition


@pytest.mark.parametrize("frame", [OFF, PASSIVE])
def test_a_reply_of_the_arm_clears_every_bus_condition(frame):
    errors = after(frame)
    errors.confirm()
    assert errors.condition is BusCondition.SOUND
    assert errors.frames == 1


def test_errors_are_counted_by_kind():
    errors = after(PASSIVE, PASSIVE, OFF)
    assert errors.frames == 3
    assert errors.text() == "bus-off 1, passive 2"
    assert not after().text()
