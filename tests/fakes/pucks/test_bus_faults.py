"""Each fault of the simulated bus has its stated effect."""

import errno
from itertools import pairwise

import can
import pytest

from acquisition.devices import SafetyMode
from fakes.pucks.bus_faults import FOREIGN_IDS
from fakes.pucks.event_queue import FRAME_NS
from fakes.world.faults import clear_network_faults, network_faults
from tests.fakes.stepped import Rig
from wam.bus.error_frames import error_names
from wam.bus.frames import decode_position, position_reply_id
from wam.driver.pendant import SafetyLevel

MS = 1_000_000
HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
THREE = position_reply_id(3)
ALL = [position_reply_id(node) for node in range(1, 8)]


@pytest.fixture
def rig():
    return Rig(counts=HOME_COUNTS)


@pytest.fixture
def faults(rig):
    return rig.network.faults


def ask(rig):
    """Request all positions; return the replies within two milliseconds."""
    rig.link.send(0x404, b"\x30")
    rig.rest(2 * MS)
    return [(frame.can_id, bytes(frame.data)) for frame in rig.link.receive()]


def ids(frames):
    return [can_id for can_id, _ in frames]


def test_the_next_replies_are_lost_and_no_more(rig, faults):
    faults.drop(THREE, 2)
    assert [ids(ask(rig)).count(THREE) for _ in range(4)] == [0, 0, 1, 1]


def test_a_reproducible_share_of_replies_is_lost():
    def losses():
        rig = Rig(counts=HOME_COUNTS)
        rig.network.faults.drop(THREE, None, share=0.2)
        return [THREE not in ids(ask(rig)) for _ in range(300)]

    lost = losses()
    assert 35 <= sum(lost) <= 85  # 60 expected, 7 is a standard deviation
    assert lost == losses()


def test_only_the_delayed_reply_is_late(rig, faults):
    faults.delay(THREE, 5 * MS)
    assert ids(ask(rig)) == [i for i in ALL if i != THREE]
    rig.rest(5 * MS)
    assert [frame.can_id for frame in rig.link.receive()] == [THREE]


def test_replies_of_one_puck_never_overtake_each_other(rig, faults):
    faults.delay(THREE, 5 * MS)
    seen = []
    for position in (100, 200, 300, 400):
        rig.motors.position[2] = position
        seen += [decode_position(d) for i, d in ask(rig) if i == THREE]
    rig.rest(5 * MS)
    seen += [decode_position(f.data) for f in rig.link.receive()]
    assert seen == [100, 200, 300, 400]


def test_a_doubled_reply_arrives_twice(rig, faults):
    faults.duplicate(THREE)
    assert [ids(ask(rig)).count(THREE) for _ in range(2)] == [2, 1]


def test_a_corrupted_reply_differs_in_one_byte(rig, faults):
    (clean,) = [d for i, d in ask(rig) if i == THREE]
    faults.corrupt(THREE, byte=1)
    (damaged,) = [d for i, d in ask(rig) if i == THREE]
    assert [a ^ b for a, b in zip(clean, damaged, strict=True)] == [0, 0xFF, 0]


@pytest.mark.parametrize("load", [0.3, 0.6])
def test_a_flood_uses_its_share_of_the_bus(rig, faults, load):
    faults.flood(load)
    rig.rest(500 * MS)
    found = [frame.can_id for frame in rig.link.receive()]
    while frames := rig.link.receive():
        found += [frame.can_id for frame in frames]
    # Pauses vary by half: 29 % of one pause, over some 1,300 of them below 1 %.
    assert len(found) * FRAME_NS[8] / (500 * MS) == pytest.approx(load, rel=0.03)
    assert set(found) == set(FOREIGN_IDS)


def test_a_flood_delays_replies_by_identifier_priority(rig, faults):
    def last_reply(chosen):
        faults.clear_faults()
        faults.flood(0.4, chosen)
        begin = rig.clock.t_ns
        rig.link.send(0x404, b"\x30")
        rig.rest(2 * MS)
        stamps = [f.t_ns for f in rig.link.receive() if f.can_id in ALL]
        assert len(stamps) == 7
        return max(stamps) - begin

    first, last = FOREIGN_IDS
    alone = FRAME_NS[1] + 75_000 + 7 * FRAME_NS[3]
    # A frame of lower priority may already occupy the wire.
    assert last_reply([last]) <= alone + 2 * FRAME_NS[8]
    assert last_reply([first]) > alone + 2 * FRAME_NS[8]


def test_an_interface_that_is_down_neither_sends_nor_receives(rig, faults):
    rig.link.send(0x404, b"\x30")
    rig.rest(MS)
    faults.go_down()
    with pytest.raises(can.CanOperationError, match="down"):
        rig.bus.send(can.Message(arbitration_id=1, is_extended_id=False, data=b"\5"))
    with pytest.raises(can.CanOperationError, match="down"):
        rig.bus.recv(0)
    faults.clear_faults()
    assert rig.bus.recv(0) is None  # waiting frames are lost
    assert ids(ask(rig)) == ALL


def send(rig, can_id=0x404, data=b"\x30"):
    rig.bus.send(can.Message(arbitration_id=can_id, is_extended_id=False, data=data))


def test_a_bus_off_controller_accepts_frames_and_reports_once(rig, faults):
    faults.go_off()
    send(rig)
    report = rig.bus.recv(0)
    assert report.is_error_frame
    assert error_names(report.arbitration_id, report.data) == {"bus-off"}
    rig.rest(2 * MS)
    assert rig.bus.recv(0) is None
    faults.clear_faults()
    report = rig.bus.recv(0)
    assert error_names(report.arbitration_id, report.data) == {"restarted"}
    assert rig.bus.recv(0) is None  # frames sent meanwhile are lost
    assert ids(ask(rig)) == ALL


def test_unacknowledged_frames_wait_until_the_queue_is_full(rig, faults):
    faults.stop_acknowledging()
    for _ in range(11):
        send(rig)
    with pytest.raises(can.CanOperationError) as refused:
        send(rig)
    assert refused.value.error_code == errno.ENOBUFS
    report = rig.bus.recv(0)
    assert error_names(report.arbitration_id, report.data) == {"passive"}
    faults.clear_faults()
    send(rig)
    rig.rest(20 * MS)
    replies = [rig.bus.recv(0) for _ in range(12 * 7)]
    assert None not in replies  # all waiting frames were sent


def test_repairing_ends_every_bus_fault(rig, faults):
    faults.drop(THREE, None)
    faults.flood(0.9)
    ask(rig)
    faults.clear_faults()
    ask(rig)
    assert ids(ask(rig)) == ALL


def test_swapped_replies_arrive_last(rig):
    network_faults(rig.network)["reply-swapped"]()
    assert ids(ask(rig)) == [*(i for i in ALL if i != THREE), THREE]


@pytest.mark.parametrize(
    ("name", "monitor", "mode"),
    [
        ("safety-speed", "velocity", SafetyMode.IDLE),
        ("safety-torque", "torque", SafetyMode.IDLE),
        ("safety-heartbeat", "heartbeat", SafetyMode.IDLE),
        ("safety-voltage", "voltage", SafetyMode.E_STOP),
    ],
)
def test_a_faulted_monitor_can_be_cleared_once_repaired(rig, name, monitor, mode):
    def move(cycles=60):  # of 2 ms: longer than the heartbeat
        for _ in range(cycles):
            rig.motors.position[3] += 20
            ask(rig)
            rig.link.send(0x401, bytes.fromhex("aa 00 0b ff f0 00 bf fe"))

    rig.network.pendant("activate")
    move()
    assert rig.network.safety_mode is SafetyMode.ACTIVE
    network_faults(rig.network)[name]()
    move()
    assert rig.network.safety_mode is mode
    assert getattr(rig.network.pendant_state, monitor) is SafetyLevel.FAULT
    clear_network_faults(rig.network)
    rig.network.pendant("idle")
    rig.network.pendant("activate")
    move(40)  # pucks that lost their power are asleep, which is no lost heartbeat yet
    assert rig.network.safety_mode is SafetyMode.ACTIVE


@pytest.mark.parametrize(
    ("name", "request_", "faulty", "sound"),
    [("puck-hot", 9, 72, 35), ("puck-error", 4, 7, 0)],
)
def test_a_faulty_puck_reports_its_fault_until_repaired(
    rig, name, request_, faulty, sound
):
    def answer():
        rig.link.send(3, bytes((request_,)))
        rig.rest(MS)
        return rig.link.receive()[0].data[2]

    network_faults(rig.network)[name]()
    assert answer() == faulty
    clear_network_faults(rig.network)
    assert answer() == sound


def test_a_rebooted_puck_answers_no_positions_but_other_requests(rig):
    network_faults(rig.network)["puck-reboot"]()
    assert ids(ask(rig)) == [i for i in ALL if i != THREE]
    rig.link.send(3, b"\x05")
    rig.rest(MS)
    assert bytes(rig.link.receive()[0].data) == b"\x85\0\0\0"  # STAT 0


def test_replies_on_a_quiet_wire_follow_each_other_closely(rig):
    rig.link.send(0x404, b"\x30")
    rig.rest(2 * MS)
    stamps = [f.t_ns for f in rig.link.receive()]
    gaps = [b - a for a, b in pairwise(stamps)]
    assert gaps == pytest.approx([FRAME_NS[3]] * 6, abs=2)  # stamped in float seconds
