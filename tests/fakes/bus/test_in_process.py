from itertools import pairwise

import can
import pytest

from fakes.pucks.event_queue import FRAME_NS
from tests.fakes.stepped import Rig


def message(can_id, data, **flags):
    flags.setdefault("is_extended_id", False)
    return can.Message(arbitration_id=can_id, data=data, **flags)


@pytest.fixture
def rig():
    rig = Rig()
    yield rig
    rig.bus.shutdown()


def arrivals(rig):
    found = []
    while (frame := rig.bus.recv(0)) is not None:
        found.append(frame)
    return found


def test_nothing_arrives_before_its_last_bit(rig):
    begin_ns = rig.clock.t_ns
    rig.bus.send(message(1, b"\x05"))
    # Request on the wire, 85 us of processing, reply on the wire.
    last_bit_ns = begin_ns + FRAME_NS[1] + 85_000 + FRAME_NS[4]
    rig.clock.sleep_until(last_bit_ns - 1)
    assert rig.bus.recv(0) is None
    rig.clock.sleep_until(last_bit_ns)
    reply = rig.bus.recv(0)
    assert reply.arbitration_id == 0x426
    # A float of seconds resolves far less than a microsecond.
    assert reply.timestamp == pytest.approx(last_bit_ns / 1e9, abs=1e-7)


def test_the_bus_carries_one_frame_at_a_time(rig):
    rig.bus.send(message(0x404, b"\x30"))
    rig.rest(2_000_000)
    stamps = [round(frame.timestamp * 1e9) for frame in arrivals(rig)]
    gaps = {b - a for a, b in pairwise(stamps)}
    assert len(stamps) == 7
    # A float of seconds may be off by a nanosecond.
    assert all(abs(gap - FRAME_NS[3]) <= 2 for gap in gaps)


def test_seven_positions_arrive_within_their_time_budget(rig):
    rig.bus.send(message(0x404, b"\x30"))
    rig.rest(700_000)
    assert len(arrivals(rig)) == 7


def test_the_lowest_identifier_wins_the_wire(rig):
    rig.bus.send(message(0x001, b"\x30"))  # keeps the wire busy while others queue
    rig.bus.send(message(0x00A, b"\x08"))
    rig.bus.send(message(0x404, b"\x30"))
    rig.bus.send(message(0x001, b"\x05"))
    rig.rest(3_000_000)
    ids = [frame.arbitration_id for frame in arrivals(rig)]
    assert ids.index(0x423) < ids.index(0x426) < ids.index(0x546)
    assert ids[-1] == 0x546


def test_own_frames_do_not_come_back(rig):
    rig.bus.send(message(0x401, bytes.fromhex("aa" + "00" * 7)))
    rig.rest(1_000_000)
    assert arrivals(rig) == []


@pytest.mark.parametrize("flag", ["is_extended_id", "is_remote_frame"])
def test_frames_of_another_kind_are_not_delivered(rig, flag):
    rig.bus.send(message(1, b"" if flag == "is_remote_frame" else b"\x05", **{flag: 1}))
    rig.rest(1_000_000)
    assert arrivals(rig) == []


def test_a_receive_with_a_timeout_advances_simulated_time(rig):
    begin_ns = rig.clock.t_ns
    rig.bus.send(message(1, b"\x05"))
    assert rig.bus.recv(1.0).arbitration_id == 0x426
    assert rig.clock.t_ns - begin_ns < 1_000_000


def test_a_timeout_lasts_as_requested(rig):
    begin_ns = rig.clock.t_ns
    assert rig.bus.recv(0.25) is None
    assert rig.clock.t_ns - begin_ns == 250_000_000


def test_next_event_leads_to_the_arrival_step_by_step(rig):
    assert rig.bus.next_event_ns() is None
    rig.bus.send(message(1, b"\x05"))
    steps = 0
    while (next_ns := rig.bus.next_event_ns()) is not None:
        rig.bus.advance(next_ns)
        steps += 1
    assert steps < 10
    assert rig.bus.next_event_ns() is None


def test_a_bus_that_was_shut_down_sends_nothing():
    bus = Rig().bus
    bus.shutdown()
    bus.shutdown()
    with pytest.raises(can.CanOperationError):
        bus.send(message(1, b"\x05"))


def test_an_in_process_bus_has_no_descriptor(rig):
    with pytest.raises(NotImplementedError):
        rig.bus.fileno()


def test_frame_times_lie_between_no_and_worst_case_stuffing():
    for n, wire_ns in enumerate(FRAME_NS):
        bits = 47 + 8 * n
        assert bits <= wire_ns / 1000 <= bits + (33 + 8 * n) // 4


def test_a_cycle_of_the_arm_takes_the_known_share_of_the_bus():
    busy_ns = FRAME_NS[1] + 7 * FRAME_NS[3] + 2 * FRAME_NS[8]
    # 828 us for exact examples, 1 us of rounding per frame.
    assert busy_ns == pytest.approx(828_000, abs=10_000)
