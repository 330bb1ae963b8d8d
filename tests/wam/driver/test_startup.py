"""Start-up finds late devices, names missing ones and reads the encoders."""

from dataclasses import replace
from itertools import pairwise

import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import DeviceFaultError, PreflightError
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.frames import property_reply_id
from wam.bus.properties import MAGNETIC_ENCODER, PuckRole
from wam.driver.arm import WamArm

HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
MS = 1_000_000
GET_STAT = b"\x05"


def start(rig):
    return WamArm(rig.link, rig.clock).start()


@pytest.mark.parametrize("late_ms", [3, 300, 900])
@pytest.mark.parametrize("node", [5, 10])
def test_a_device_whose_first_answer_is_late_is_found(node, late_ms):
    rig = Rig(counts=HOME_COUNTS)
    rig.network.faults.delay(property_reply_id(node), late_ms * MS)
    info = start(rig)
    assert info.nodes == (1, 2, 3, 4, 5, 6, 7, 10)
    assert info.late_replies >= 1


def test_a_puck_in_reset_is_waited_for_and_woken():
    rig = Rig(counts=HOME_COUNTS)
    rig.link.send(5, bytes.fromhex("85 00 00 00 00 00"))  # silent for half a second
    info = start(rig)
    assert [p.node for p in info.pucks if p.was_asleep] == [5]
    assert not info.is_zeroed  # it has lost its position


def test_nothing_is_sent_while_a_late_device_may_be_booting():
    rig = Rig(counts=HOME_COUNTS)
    rig.network.silence(5)
    with pytest.raises(PreflightError):
        start(rig)
    asked = [t for t, node, data in rig.sent if (node, data) == (5, GET_STAT)]
    assert len(asked) == 3
    times = sorted(t for t, _, _ in rig.sent)
    for before, after in ((asked[0], asked[1]), (asked[1], asked[2])):
        spoken = [t for t in times if before <= t <= after]
        gaps = [b - a for a, b in pairwise(spoken)]
        assert max(gaps) >= 1000 * MS


def test_a_stopped_arm_is_not_waited_for():
    rig = Rig(NetworkOptions(safety_mode=SafetyMode.E_STOP))
    before = rig.clock.t_ns
    with pytest.raises(PreflightError, match="E-stop"):
        start(rig)
    assert rig.clock.t_ns - before < 500 * MS


def test_all_missing_devices_are_reported_at_once():
    rig = Rig()
    for node in (2, 6, 10):
        rig.network.silence(node)
    with pytest.raises(PreflightError) as caught:
        start(rig)
    assert caught.value.message == (
        "The safety module and pucks 2,6 do not answer (1,3,4,5,7 on the bus)."
    )


def test_an_empty_bus_is_reported_as_empty():
    rig = Rig()
    for node in (*range(1, 8), 10):
        rig.network.silence(node)
    with pytest.raises(
        PreflightError, match=r"does not answer \(no device on the bus\)"
    ):
        start(rig)


def test_an_arm_of_four_joints_is_recognised():
    rig = Rig()
    for node in (5, 6, 7):
        rig.network.silence(node)
    with pytest.raises(PreflightError) as caught:
        start(rig)
    assert caught.value.message == "Pucks 5,6,7 do not answer (1,2,3,4 do)."
    assert "four-joint WAM" in caught.value.hint


@pytest.mark.parametrize(("poles", "kind"), [(8, "gimbals"), (10, "something unknown")])
def test_another_wrist_is_recognised_by_its_poles_and_refused(poles, kind):
    rig = Rig(NetworkOptions(poles=(12, 12, 12, 12, 8, 8, poles)))
    with pytest.raises(PreflightError) as caught:
        start(rig)
    assert f"{poles} poles: {kind}, a wrist has 6" in caught.value.message
    assert "wrist only" in caught.value.hint


def test_the_absolute_angle_of_every_motor_is_read():
    info = start(Rig(counts=HOME_COUNTS))
    assert [p.mech for p in info.pucks] == [count % 4096 for count in HOME_COUNTS]


def test_an_absolute_angle_of_32_bits_is_read_whole():
    # Optical encoders count 40960 per turn: more than a signed 16-bit word holds.
    rig = Rig(NetworkOptions(cts=(40960,) * 7), (40000, 0, 0, 0, 0, 0, -1))
    info = start(rig)
    assert (info.pucks[0].mech, info.pucks[6].mech) == (40000, 40959)


def test_older_firmware_has_no_absolute_angle():
    rig = Rig(NetworkOptions(vers=(117, 118, 200, 200, 200, 200, 200)), HOME_COUNTS)
    info = start(rig)
    assert info.pucks[0].mech is None
    assert info.pucks[1].mech == HOME_COUNTS[1] % 4096


def test_a_puck_without_a_magnetic_encoder_has_no_absolute_angle():
    rig = Rig(counts=HOME_COUNTS)
    rig.network.set_property(3, "ROLE", int(PuckRole.TATER))
    assert start(rig).pucks[2].mech is None
    rig.network.set_property(3, "ROLE", MAGNETIC_ENCODER | PuckRole.TATER)
    assert start(rig).pucks[2].mech is not None


def test_the_absolute_angle_survives_the_zeroing():
    rig = Rig(counts=(100, 200, 300, 400, 500, 600, 700))
    arm = WamArm(rig.link, rig.clock)
    before = [p.mech for p in arm.start().pucks]
    arm.define_position(arm.transmission.joints([0.0] * 7))
    assert [p.mech for p in arm.start().pucks] == before == list(rig.motors.position)


def test_a_node_that_is_not_a_motor_is_reported():
    rig = Rig(counts=HOME_COUNTS)
    rig.network.set_property(4, "ROLE", int(PuckRole.SAFETY))
    with pytest.raises(PreflightError, match=r"Node 4 is not a motor puck"):
        start(rig)


SLEEP = bytes.fromhex("85 00 00 00 00 00")


def test_a_puck_that_does_not_wake_is_reported():
    rig = Rig(counts=HOME_COUNTS)
    rig.link.send(5, SLEEP)
    rig.rest(600 * MS)
    receive = rig.network.receive
    rig.network.receive = lambda t, i, d: (
        None if i == 5 and bytes(d[:1]) == b"\x85" else receive(t, i, d)
    )
    with pytest.raises(PreflightError, match="Puck 5 does not wake up"):
        start(rig)


def test_pucks_are_woken_one_after_the_other_and_left_alone_while_they_boot():
    rig = Rig(counts=HOME_COUNTS)
    for node in (2, 5):
        rig.link.send(node, SLEEP)
    rig.rest(600 * MS)
    rig.sent.clear()
    start(rig)
    woken = [t for t, i, d in rig.sent if i in (2, 5) and len(d) == 6 and d[0] == 0x85]
    assert len(woken) == 2
    assert 10 * MS <= woken[1] - woken[0] < 15 * MS
    after = min(t for t, *_ in rig.sent if t > woken[1])
    assert after - woken[1] >= 1000 * MS


@pytest.mark.parametrize("name", ["CTS", "IPNM"])
@pytest.mark.parametrize("value", [0, -5])
def test_a_puck_without_its_constants_is_refused(name, value):
    rig = Rig(counts=HOME_COUNTS)
    rig.network.set_property(6, name, value)
    with pytest.raises(DeviceFaultError, match=f"Puck 6 .*{name} {value}"):
        start(rig)


@pytest.mark.parametrize("mode", [SafetyMode.IDLE, SafetyMode.ACTIVE])
def test_motors_are_idled_unless_the_arm_is_active(mode):
    # A heartbeat longer than the start-up.
    rig = Rig(NetworkOptions(heartbeat_ns=10_000 * MS), HOME_COUNTS)
    if mode is SafetyMode.ACTIVE:
        rig.network.pendant("activate")
    rig.sent.clear()
    info = start(rig)
    assert info.safety_mode is mode
    idled = [d for _, i, d in rig.sent if i == 0x404 and len(d) == 6 and d[0] == 0x88]
    assert idled == ([] if mode is SafetyMode.ACTIVE else [b"\x88" + bytes(5)])


def test_indistinguishable_pucks_give_a_warning():
    rig = Rig(counts=HOME_COUNTS)
    assert not any("same serial" in text for text in start(rig).warnings)
    rig.network.set_property(3, "SN", 1005)
    (warning,) = [text for text in start(rig).warnings if "same serial" in text]
    assert "1001 1002 1005 1004 1005 1006 1007" in warning


@pytest.mark.parametrize("hidden", ["safety_serial", "safety_vers", None])
def test_safety_modules_are_distinguished_only_by_complete_identities(hidden):
    info = start(Rig(counts=HOME_COUNTS))
    known = (200, info.safety_serial, 2048, 4096, 4731, 5204)
    if hidden:
        info = replace(info, **{hidden: None})
    assert info.module_identity() == (() if hidden else known)


def test_an_unread_serial_number_is_recorded_as_unknown():
    info = start(Rig(counts=HOME_COUNTS))
    assert info.metadata()["arm:serials"] == "1001 1002 1003 1004 1005 1006 1007"
    unknown = (replace(info.pucks[0], serial=None), *info.pucks[1:])
    serials = replace(info, pucks=unknown).metadata()["arm:serials"]
    assert serials == "? 1002 1003 1004 1005 1006 1007"
