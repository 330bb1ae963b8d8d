"""Traps of the WAM's protocol, numbered as in its description, each with its tests.

Tests run the driver against the simulated network, or one of the two alone.
"""

import re
from itertools import pairwise

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import PreflightError
from fakes.pucks.options import NetworkOptions
from ft_sensor.vendors.barrett_frames import (
    FORCE_ID,
    TORQUE_ID,
    BarrettCounters,
    WrenchPairing,
)
from tests.fakes.stepped import Rig
from wam.bus.frames import (
    MODE_BROADCAST_ID,
    Group,
    compose_id,
    decode_force,
    decode_position,
    decode_reply,
    decode_torques,
    encode_force,
    encode_get,
    encode_position,
    encode_set,
    encode_torque,
    encode_torques,
    position_reply_id,
    property_reply_id,
)
from wam.bus.properties import Device, names, property_number
from wam.driver.arm import WamArm
from wam.driver.pendant import SafetyLevel
from wam.driver.puck_properties import Expectation, PuckTable, shipped_table
from wam.driver.settings import ArmSettings
from wam.driver.transmission import HOST_TORQUE_LIMITS, Transmission

MS = 1_000_000
CYCLE_NS = 2 * MS
HOME = np.array([0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0])
HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
ZERO = np.zeros(7)
LOWER, WRIST = 0x401, 0x402
POWER_UP_TL1, POWER_UP_TL2 = 4731, 5204


def started(options=None, counts=HOME_COUNTS, **settings):
    rig = Rig(options, counts)
    arm = WamArm(rig.link, rig.clock, ArmSettings(**settings))
    info = arm.start()
    rig.sent.clear()
    return rig, arm, info


def cycle(rig, arm, tau=ZERO):
    reading = arm.read(rig.clock.t_ns)
    arm.send(tau, tau)
    rig.clock.sleep_until(reading.host_ns + CYCLE_NS)
    return reading


def answers(rig, can_id, data, within_ns=MS):
    """Send a frame; return (identifier, data) of the replies."""
    rig.link.send(can_id, data)
    rig.rest(within_ns)
    return [(frame.can_id, bytes(frame.data)) for frame in rig.link.receive()]


def test_trap_01_positions_are_big_endian_without_a_property_byte():
    rig = Rig(counts=HOME_COUNTS)
    position = (position_reply_id(4), bytes.fromhex("3f 70 88"))
    assert answers(rig, 4, encode_get(48)) == [position]
    cts = (property_reply_id(4), bytes.fromhex("c4 00 00 10 00 00"))
    assert answers(rig, 4, encode_get(68)) == [cts]
    assert decode_position(position[1]) == HOME_COUNTS[3]
    assert decode_reply(cts[1]).value == 4096
    # The third format: little-endian, and no property byte either.
    assert encode_force((1.0, -2.5, -9.81)) == bytes.fromhex("00 01 80 fd 31 f6")


def test_trap_02_polling_positions_is_the_heartbeat():
    rig, arm, _ = started()
    rig.network.pendant("activate")
    for _ in range(60):  # 0.12 s, longer than the heartbeat
        cycle(rig, arm)
    assert rig.network.safety_mode is SafetyMode.ACTIVE
    for _ in range(60):
        arm.send(ZERO, ZERO)  # torques alone are not enough
        rig.rest(CYCLE_NS)
    assert rig.network.safety_mode is SafetyMode.IDLE
    assert rig.network.pendant_state.heartbeat is SafetyLevel.FAULT


def test_trap_03_the_host_cannot_activate_and_does_not_try():
    rig = Rig(NetworkOptions(are_asleep=True), HOME_COUNTS)
    arm = WamArm(rig.link, rig.clock)
    arm.start()
    arm.define_position(HOME)
    for _ in range(100):
        cycle(rig, arm)
    arm.idle()
    raised = [data for _, _, data in rig.sent if data[:1] == b"\x88" and data[2] == 2]
    assert raised == []
    rig.link.send(0x00A, encode_set(8, 2))
    rig.rest(MS)
    assert rig.network.safety_mode is SafetyMode.IDLE


def test_trap_04_the_module_judges_a_torque_before_the_puck_clips_it():
    rig, arm, _ = started()
    rig.network.pendant("activate")
    cycle(rig, arm)
    # 14 bits carry it and the puck clips it to MT = 4860; the module faults anyway.
    frame = encode_torques([POWER_UP_TL2 + 1, 0, 0, 0])
    assert decode_torques(frame)[0] == POWER_UP_TL2 + 1
    rig.link.send(LOWER, frame)
    rig.rest(MS)
    assert rig.network.pendant_state.torque is SafetyLevel.FAULT
    assert rig.network.safety_mode is SafetyMode.IDLE


def test_trap_04_the_driver_clips_below_the_warning_of_the_module():
    rig, arm, _ = started()
    rig.network.pendant("activate")
    for sign in (1.0, -1.0):
        cycle(rig, arm, np.full(7, sign * 1000.0))
        assert rig.network.pendant_state.torque is SafetyLevel.SAFE
    assert max(HOST_TORQUE_LIMITS) < POWER_UP_TL1


@pytest.mark.parametrize(("group", "slot"), [(LOWER, 0), (WRIST, 2)])
def test_trap_05_one_limit_serves_motors_of_different_scale(group, slot):
    rig, arm, info = started()
    rig.network.pendant("activate")
    cycle(rig, arm)
    units = [0] * 4
    units[slot] = POWER_UP_TL2 + 1
    rig.link.send(group, encode_torques(units))
    rig.rest(MS)
    assert rig.network.pendant_state.torque is SafetyLevel.FAULT
    motor = slot if group == LOWER else 4 + slot
    limit = POWER_UP_TL2 / info.pucks[motor].ipnm
    assert limit == pytest.approx(1.93 if group == LOWER else 0.298, abs=0.005)


def test_trap_06_torque_units_and_counts_are_read_from_the_pucks():
    def units_and_angle(**constants):
        known = {n.upper(): Expectation(values=row) for n, row in constants.items()}
        pucks = shipped_table().overridden(PuckTable(**known))
        rig, arm, _ = started(
            NetworkOptions(**constants), counts=(4096,) * 7, pucks=pucks
        )
        reading = cycle(rig, arm, np.full(7, 0.5))
        sent = {can_id: data for _, can_id, data in rig.sent}
        return decode_torques(sent[LOWER])[0], reading.q[0]

    usual = units_and_angle()
    older = units_and_angle(ipnm=(1350,) * 7, cts=(40960,) * 7)
    # Half the units make the same torque, a tenth of a turn is the same count.
    assert older[0] == pytest.approx(usual[0] / 2, abs=1)
    assert older[1] == pytest.approx(usual[1] / 10, rel=1e-9)


def test_trap_07_a_set_is_not_acknowledged():
    rig = Rig(counts=HOME_COUNTS)
    for can_id, data in [
        (1, encode_set(48, 100)),
        (0x404, encode_set(8, 0)),
        (0x00A, encode_set(45, 2048)),
        (LOWER, encode_torques([0, 0, 0, 0])),
    ]:
        assert answers(rig, can_id, data, 50 * MS) == []


def test_trap_08_every_device_answers_within_a_millisecond():
    rig = Rig(counts=HOME_COUNTS)
    for node in (*range(1, 8), 10):
        (reply,) = answers(rig, node, encode_get(5), MS - 1)
        assert reply == (property_reply_id(node), b"\x85\0\2\0")


def test_trap_08_a_device_that_answers_too_late_counts_as_absent():
    rig = Rig(counts=HOME_COUNTS)
    rig.network.faults.delay(property_reply_id(5), 10_000 * MS, None)
    with pytest.raises(PreflightError, match="Puck 5 does not answer"):
        WamArm(rig.link, rig.clock).start()


def test_trap_09_the_bus_is_quiet_while_pucks_boot():
    rig = Rig(NetworkOptions(are_asleep=True))
    WamArm(rig.link, rig.clock).start()
    wake = encode_set(5, 2)
    woken = [(t, node) for t, node, data in rig.sent if data == wake]
    assert [node for _, node in woken] == [1, 2, 3, 4, 5, 6, 7]
    times = [t for t, _ in woken]
    assert {b - a for a, b in pairwise(times)} == {10 * MS}
    assert min(t for t, _, _ in rig.sent if t > times[-1]) - times[-1] >= 1000 * MS


def test_trap_10_the_firmware_version_is_read_after_waking():
    options = NetworkOptions(are_asleep=True, monitor_vers=5, vers=(128,) * 7)
    rig = Rig(options, HOME_COUNTS)
    asleep = answers(rig, 1, encode_get(0))
    assert decode_reply(asleep[0][1]).value == 5
    info = WamArm(rig.link, rig.clock).start()
    assert {puck.vers for puck in info.pucks} == {128}


def test_trap_10_numbers_move_with_firmware_and_device():
    hold = [property_number(Device.MOTOR, "HOLD", vers) for vers in (128, 200)]
    assert hold == [94, 77]
    meaning = (names(Device.MOTOR, 200)[42], names(Device.SAFETY, 200)[42])
    assert meaning == ("T", "ZERO")
    # 77 is EN before firmware 132: the puck obeys its own table.
    rig = Rig(NetworkOptions(vers=(128,) * 7))
    rig.link.send(1, encode_set(94, 1))
    assert decode_reply(answers(rig, 1, encode_get(94))[0][1]).value == 1
    assert answers(rig, 1, encode_get(77)) != answers(rig, 1, encode_get(94))


@pytest.mark.parametrize("is_announced", [True, False])
def test_trap_11_defined_positions_jump_and_are_announced(is_announced):
    rig, arm, _ = started(NetworkOptions(is_zeroed=False), counts=(500,) * 7)
    for _ in range(5):
        cycle(rig, arm)
    if is_announced:
        arm.define_position(HOME)
    else:
        for node, counts in enumerate(HOME_COUNTS, 1):
            rig.link.send(node, encode_set(48, counts))
            rig.rest(MS)
    cycle(rig, arm)
    level = rig.network.pendant_state.velocity
    assert level is (SafetyLevel.SAFE if is_announced else SafetyLevel.FAULT)


def test_trap_12_counts_and_the_frames_torques_are_floored():
    settings = ArmSettings()
    gear = Transmission(settings.j2mp, (4096,) * 7, (2700,) * 7)
    tiny = np.array([1e-6, 0, 0, 0, 0, 0, 0])
    assert abs(gear.exact_counts(tiny)[0]) < 0.5  # rounding would give 0 twice
    assert {gear.counts(tiny)[0], gear.counts(-tiny)[0]} == {-1, 0}
    assert decode_torques(encode_torques([-64.28, 64.99, 0, 0]))[:2] == (-65, 64)


def test_trap_12_the_driver_rounds_torques_before_they_are_floored():
    rig, arm, info = started()
    unit = 42.0 / info.pucks[0].ipnm  # joint torque of one unit of motor 1 [N m]
    rig.sent.clear()
    for part in (-0.4, 0.4):
        arm.send(np.array([part * unit, 0, 0, 0, 0, 0, 0]), ZERO)
    sent = [decode_torques(d)[0] for _, can_id, d in rig.sent if can_id == LOWER]
    assert sent == [0, 0]


def test_trap_13_a_force_is_accepted_only_with_its_torque_of_6_or_7_bytes():
    pairing = WrenchPairing(BarrettCounters())
    found = []
    for status in (None, 0xC4):
        pairing.ask(0)
        assert pairing.on_frame(FORCE_ID, encode_force((1.0, 2.0, 3.0))) is None
        torque = encode_torque((0.1, 0.2, 0.3), status)
        assert len(torque) == (6 if status is None else 7)
        found.append(pairing.on_frame(TORQUE_ID, torque))
    assert [(s.is_valid, s.status) for s in found] == [(True, 0), (False, 0xC4)]
    assert decode_force(encode_force((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)


def test_trap_14_group_4_is_the_whole_arm():
    rig = Rig(counts=HOME_COUNTS)
    assert int(Group.ARM) == 4
    replies = answers(rig, compose_id(0, 4, is_group=True), encode_get(48))
    assert [i for i, _ in replies] == [position_reply_id(n) for n in range(1, 8)]
    # Group 5 belongs to a hand, not to the wrist.
    assert answers(rig, compose_id(0, 5, is_group=True), encode_get(48)) == []


def test_trap_15_frames_540_cause_a_request_and_are_not_trusted():
    rig, arm, _ = started()
    for _ in range(5):
        cycle(rig, arm)
    rig.sent.clear()
    # A broadcast only causes a request of the mode; its content is not trusted.
    due = rig.network.due
    lie = [(rig.clock.t_ns, MODE_BROADCAST_ID, encode_position(0) + b"\2")]
    rig.network.due = lambda t_ns: [*due(t_ns), *(lie.pop() for _ in lie[:])]
    for _ in range(3):
        assert cycle(rig, arm).is_complete
    assert arm.safety_mode() is SafetyMode.IDLE
    assert (0x00A, encode_get(8)) in [(i, d) for _, i, d in rig.sent]
    assert arm.counters.malformed == 0


def test_the_list_of_traps_is_complete():
    numbers = {
        int(m[1]) for name in globals() if (m := re.match(r"test_trap_(\d+)_", name))
    }
    assert numbers == set(range(1, 16))
