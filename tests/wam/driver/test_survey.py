"""Devices and frames on a bus are counted before the arm is started."""

from collections import Counter

import pytest

from tests.fakes.stepped import Rig
from wam.bus.frames import MOTOR_NODES, SAFETY_NODE, encode_reply, property_reply_id
from wam.driver.arm import WamArm
from wam.driver.survey import RestTraffic

MS = 1_000_000
NODES = [*MOTOR_NODES, SAFETY_NODE]
GET_STAT, STAT = b"\x05", 5
ONCE = [1] * len(NODES)


@pytest.fixture
def rig():
    return Rig()


def count(rig, times=1):
    return WamArm(rig.link, rig.clock).survey().count_answers(times)


def listen(rig, duration_ms):
    return WamArm(rig.link, rig.clock).survey().listen(duration_ms * MS)


def test_each_device_of_a_sound_arm_answers_each_question_once(rig):
    answers = count(rig, 3)
    assert (answers.nodes, answers.counts, answers.differing) == (NODES, ONCE, [])
    asked = Counter((node, data) for _, node, data in rig.sent)
    assert asked == {(node, GET_STAT): 3 for node in NODES}


def test_a_silent_device_has_no_reply(rig):
    rig.network.silence(4)
    assert count(rig).counts == [1, 1, 1, 0, 1, 1, 1, 1]


@pytest.mark.parametrize("node", [1, 7, 10])
@pytest.mark.parametrize(("after_ms", "found"), [(0, 2), (4, 2), (6, 1)])
def test_two_devices_with_one_node_number_are_counted(rig, node, after_ms, found):
    faults = rig.network.faults
    faults.answer_twice(property_reply_id(node), lambda data: data, after_ms * MS)
    answers = count(rig)
    assert answers.counts[NODES.index(node)] == found
    assert sum(answers.counts) == len(NODES) - 1 + found
    assert answers.differing == []


def test_devices_with_one_node_number_that_disagree_are_reported(rig):
    other = encode_reply(STAT, 0, is_wide=False)
    rig.network.faults.answer_twice(property_reply_id(5), lambda _: other, MS)
    assert count(rig, 2).differing == [5]


def test_a_request_answered_twice_once_is_counted(rig):
    rig.network.faults.duplicate(property_reply_id(2), 1)
    assert count(rig, 3).counts == [1, 2, *ONCE[2:]]


@pytest.mark.parametrize(
    "other", [encode_reply(STAT + 1, 2, is_wide=False), b"\x05", b"", bytes(8)]
)
def test_a_reply_that_does_not_match_the_request_is_ignored(rig, other):
    rig.network.faults.answer_twice(property_reply_id(5), lambda _: other, MS)
    answers = count(rig)
    assert (answers.counts, answers.differing) == (ONCE, [])


def test_a_reply_from_before_the_request_is_ignored(rig):
    rig.link.send(3, GET_STAT)
    rig.link.send(1, GET_STAT)
    rig.rest(2 * MS)
    assert count(rig).counts == ONCE


def test_listening_to_a_quiet_bus_lasts_as_requested_and_sends_nothing(rig):
    before_ns = rig.clock.t_ns
    assert listen(rig, 50) == RestTraffic(frames=0, master=None, error_frames=0)
    assert rig.clock.t_ns - before_ns == 50 * MS
    assert rig.sent == []


def test_frames_up_to_the_end_of_listening_are_counted(rig):
    rig.link.send(3, GET_STAT)
    rig.rest(2 * MS)
    for node, late_ms in ((4, 20), (5, 40), (6, 60)):
        rig.network.faults.delay(property_reply_id(node), late_ms * MS)
        rig.link.send(node, GET_STAT)
    assert listen(rig, 50).frames == 3


def test_another_master_and_bus_errors_are_reported(rig):
    rig.network.faults.report_error(0x004)
    rig.network.other_master.join(3)
    heard = listen(rig, 20)
    assert heard.master == 0x401 | 3 << 5
    assert heard.error_frames == 1
