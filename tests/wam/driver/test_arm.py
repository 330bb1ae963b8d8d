import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import (
    DeviceFaultError,
    LinkError,
    LinkTimeoutError,
    PreflightError,
)
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.frames import MOTOR_NODES, decode_torques
from wam.driver.arm import WamArm
from wam.driver.home import HOME_LIMIT
from wam.driver.settings import ArmSettings

HOME = np.array([0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0])
HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
TAU = np.array([1.0, -15.0, 2.0, 5.0, 0.3, -0.2, 0.05])
ZERO = np.zeros(7)
CYCLE_NS = 2_000_000
GET_P = (0x404, b"\x30")
GET_MODE = (0x00A, b"\x08")
SAFETY_TO_IDLE = (0x00A, bytes.fromhex("88 00 01 00 00 00"))


def started(options=None, counts=HOME_COUNTS, **settings):
    rig = Rig(options, counts)
    arm = WamArm(rig.link, rig.clock, ArmSettings(**settings))
    arm.start()
    rig.sent.clear()
    return rig, arm


def cycle(rig, arm, tau=None):
    reading = arm.read(rig.clock.t_ns)
    if tau is not None:
        arm.send(tau, ZERO)
    rig.clock.sleep_until(reading.host_ns + CYCLE_NS)
    return reading


def frames(rig):
    return [(can_id, data) for _, can_id, data in rig.sent]


def test_an_awake_arm_starts_without_waking_its_pucks():
    rig = Rig(counts=HOME_COUNTS)
    arm = WamArm(rig.link, rig.clock)
    info = arm.start()
    assert info.nodes == (1, 2, 3, 4, 5, 6, 7, 10)
    assert info.is_zeroed
    assert info.safety_mode is SafetyMode.IDLE
    assert [p.ipnm for p in info.pucks] == [2700] * 4 + [6500] * 2 + [17474]
    assert not any(p.was_asleep for p in info.pucks)
    assert (1, bytes.fromhex("85 00 02 00 00 00")) not in frames(rig)
    assert arm.safety_mode() is SafetyMode.IDLE


@pytest.mark.parametrize("vers", [33, 61, 200])
def test_the_first_positions_cause_no_speed_fault_of_the_module(vers):
    number = {33: 102, 61: 55, 200: 55}[vers]  # of IFAULT
    rig = Rig(NetworkOptions(safety_vers=vers), HOME_COUNTS)
    arm = WamArm(rig.link, rig.clock)
    for _ in range(2):  # every start, not only the first
        rig.sent.clear()
        arm.start()
        sent = frames(rig)
        writes = [(i, d) for i, d in enumerate(sent) if d[1][0] == 0x80 | number]
        (before, five), (after, none) = writes
        assert five == (0x00A, bytes((0x80 | number, 0, 5, 0, 0, 0)))
        assert none == (0x00A, bytes((0x80 | number, 0, 0, 0, 0, 0)))
        asked = [i for i, frame in enumerate(sent) if frame == GET_P]
        assert before + 1 == asked[0]  # the history holds five samples
        assert len(asked) > 5
        assert asked[-1] < after


def test_a_missing_puck_is_reported_with_those_that_answer():
    rig = Rig()
    rig.network.silence(5)
    with pytest.raises(PreflightError) as caught:
        WamArm(rig.link, rig.clock).start()
    assert caught.value.message == "Puck 5 does not answer (1,2,3,4,6,7 do)."
    assert caught.value.hint == "Check its cable and power; it may be in reset."


def test_two_missing_pucks_are_reported_in_the_plural():
    rig = Rig()
    rig.network.silence(1)
    rig.network.silence(5)
    with pytest.raises(PreflightError, match=r"Pucks 1,5 do not answer \(2,3,4,6,7"):
        WamArm(rig.link, rig.clock).start()


def test_a_stopped_arm_asks_for_its_release():
    rig = Rig(NetworkOptions(safety_mode=SafetyMode.E_STOP))
    with pytest.raises(PreflightError, match="E-stop") as caught:
        WamArm(rig.link, rig.clock).start()
    assert "Shift-idle" in caught.value.hint


def test_a_missing_safety_module_has_its_own_error():
    rig = Rig()
    rig.network.silence(10)
    with pytest.raises(PreflightError, match="safety module does not answer"):
        WamArm(rig.link, rig.clock).start()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (NetworkOptions(poles=(12, 12, 12, 12, 8, 8, 8)), "8 poles: gimbals"),
        (NetworkOptions(are_asleep=True, boot_ns=2_000_000_000), "not wake up"),
    ],
)
def test_an_arm_of_another_kind_is_refused(options, words):
    rig = Rig(options)
    with pytest.raises(PreflightError, match=words):
        WamArm(rig.link, rig.clock).start()


def test_reading_before_start_is_refused():
    rig = Rig()
    with pytest.raises(DeviceFaultError, match="not started"):
        WamArm(rig.link, rig.clock).read(rig.clock.t_ns)


def test_a_reading_has_seven_joints_within_its_cycle():
    rig, arm = started()
    reading = cycle(rig, arm)
    assert reading.is_complete
    assert reading.fresh == 0b1111111
    assert tuple(reading.counts) == HOME_COUNTS
    # One count of floor in each of two motors.
    assert reading.q == pytest.approx(HOME, abs=1.2e-4)
    assert 0 < reading.arm_ns - reading.host_ns <= 1_500_000
    assert frames(rig)[0] == GET_P


@pytest.mark.parametrize("silent", [0, 1, 4, 7])
def test_a_reading_states_which_motors_answered_and_when(silent):
    rig, arm = started()
    first = cycle(rig, arm)
    rig.network.silence(silent or 10)
    reading = cycle(rig, arm)
    is_complete = silent == 0
    assert reading.host_ns == first.host_ns + CYCLE_NS
    # Seven replies take 0.7 ms on the wire; the other six arrive normally.
    assert 500_000 < reading.arm_ns - reading.host_ns <= 1_500_000
    assert reading.fresh == 0b1111111 & ~(1 << silent >> 1)
    assert reading.is_complete is is_complete
    assert reading.missing_cycles == 1 - is_complete
    assert tuple(reading.counts) == HOME_COUNTS
    assert reading.q == pytest.approx(first.q, abs=0.0)
    assert not reading.qd.any()


def test_replies_before_the_bus_broke_keep_their_time():
    rig, arm = started()
    receive = rig.link.receive
    calls = []

    def breaking():
        calls.append(rig.clock.t_ns)
        if len(calls) == 3:  # drained, polled, and now gone
            raise LinkError("gone")
        return receive()

    rig.network.silence(7)
    rig.link.receive = breaking
    rig.link.is_readable = lambda: True
    reading = cycle(rig, arm)
    assert reading.fresh
    assert reading.arm_ns == calls[1]


def test_a_joint_at_rest_has_no_velocity():
    rig, arm = started()
    reading = cycle(rig, arm)
    assert not reading.qd.any()
    assert reading.qd7_raw == 0.0


def test_velocity_passes_the_first_order_filter():
    rig, arm = started()
    cycle(rig, arm)
    rig.motors.position[6] += 100
    reading = cycle(rig, arm)
    raw = -100 * 2 * np.pi / 4096 / 14.93 / 0.002
    assert reading.qd7_raw == pytest.approx(raw, rel=1e-9)
    # 180 rad/s at 2 ms: 0.36 / 1.36 = 0.265 of the step.
    assert reading.qd[6] == pytest.approx(raw * 0.36 / 1.36, rel=1e-9)
    assert cycle(rig, arm).qd[6] == pytest.approx(raw * 0.36 / 1.36**2, rel=1e-9)


def test_velocity_uses_the_measured_time():
    rig, arm = started()
    cycle(rig, arm)
    rig.rest(2_000_000)
    rig.motors.position[6] += 100
    reading = cycle(rig, arm)
    raw = -100 * 2 * np.pi / 4096 / 14.93 / 0.004
    assert reading.qd7_raw == pytest.approx(raw, rel=1e-9)


def moving(rig, arm, cycles):
    """Turn motor 7 by 100 counts per cycle; return the last reading."""
    for _ in range(cycles):
        rig.motors.position[6] += 100
        reading = cycle(rig, arm)
    return reading


def test_a_dropped_reply_is_extrapolated_and_marked():
    rig, arm = started()
    before = moving(rig, arm, 60)
    rig.network.silence(7)
    rig.motors.position[6] += 100
    reading = cycle(rig, arm)
    assert reading.fresh == 0b0111111
    assert not reading.is_complete
    assert reading.missing_cycles == 1
    assert reading.counts[6] == before.counts[6]
    step = -100 * 2 * np.pi / 4096 / 14.93
    # The filter has settled to 1e-8 after 60 cycles.
    assert reading.q[6] - before.q[6] == pytest.approx(step, rel=1e-6)
    assert reading.qd[6] == pytest.approx(before.qd[6], rel=1e-6)


def test_missing_cycles_count_until_all_are_back():
    rig, arm = started()
    rig.network.silence(3)
    assert [cycle(rig, arm).missing_cycles for _ in range(3)] == [1, 2, 3]
    rig.network.silence(3, is_mute=False)
    assert cycle(rig, arm).missing_cycles == 0


def test_a_joint_that_returns_has_its_mean_velocity():
    rig, arm = started()
    moving(rig, arm, 60)
    rig.network.silence(7)
    moving(rig, arm, 3)
    rig.network.silence(7, is_mute=False)
    reading = moving(rig, arm, 1)
    step = -100 * 2 * np.pi / 4096 / 14.93
    assert reading.qd[6] == pytest.approx(step / 0.002, rel=1e-6)


def test_a_joint_silent_for_long_is_taken_to_be_at_rest():
    rig, arm = started()
    moving(rig, arm, 60)
    rig.network.silence(7)
    readings = [cycle(rig, arm) for _ in range(40)]
    assert readings[30].q[6] == readings[39].q[6]
    assert readings[10].q[6] != readings[20].q[6]


def test_waiting_for_a_missing_reply_ends_at_the_deadline():
    rig, arm = started()
    rig.network.silence(7)
    begin_ns = rig.clock.t_ns
    arm.read(begin_ns)
    assert rig.clock.t_ns - begin_ns == 1_500_000


@pytest.mark.parametrize(("share", "is_fresh"), [(0.99, True), (1.01, False)])
def test_a_position_beyond_the_plausible_speed_is_rejected(share, is_fresh):
    rig, arm = started()
    cycle(rig, arm)
    settings = ArmSettings()
    fastest = arm.transmission.fastest_counts(np.array(settings.speed_limits))[2]
    jump = round(share * (settings.jump_margin * fastest * CYCLE_NS * 1e-9 + 4))
    rig.motors.position[2] += jump
    reading = cycle(rig, arm)
    assert bool(reading.fresh & 0b100) is is_fresh
    assert arm.counters.rejected == (0 if is_fresh else 1)
    moved = HOME_COUNTS[2] + jump if is_fresh else HOME_COUNTS[2]
    assert reading.counts[2] == moved


def test_positions_after_a_pause_are_accepted():
    rig, arm = started()
    cycle(rig, arm)
    rig.motors.position[2] += 5000
    rig.rest(500_000_000)
    assert cycle(rig, arm).is_complete


def test_stale_replies_are_drained_and_counted():
    rig, arm = started()
    cycle(rig, arm)
    rig.link.send(*GET_P)
    rig.rest(1_000_000)
    rig.motors.position[0] += 10
    reading = cycle(rig, arm)
    assert arm.counters.stale == 7
    assert reading.counts[0] == HOME_COUNTS[0] + 10


def test_a_malformed_reply_counts_as_missing(monkeypatch):
    rig, arm = started()
    receive = rig.link.receive

    def garble():
        return [
            frame._replace(data=b"\xff\xff") if frame.can_id == 0x463 else frame
            for frame in receive()
        ]

    monkeypatch.setattr(rig.link, "receive", garble)
    assert cycle(rig, arm).fresh == 0b1111011
    assert arm.counters.malformed == 1


def broken(*_):
    raise LinkError("gone")


def test_a_dead_bus_reads_as_missing_replies():
    rig, arm = started()
    rig.link.send = broken
    reading = arm.read(rig.clock.t_ns)
    assert (reading.fresh, reading.arm_ns) == (0, 0)
    assert arm.counters.link_errors > 0


def test_torques_go_to_both_groups_rounded():
    rig, arm = started()
    sent = arm.send(TAU, ZERO)
    by_id = dict(frames(rig))
    assert decode_torques(by_id[0x401]) == (-64, -878 + 1, 556, -750)
    assert decode_torques(by_id[0x402]) == (168, 34, -59, 0)
    units = [-64, -877, 556, -750, 168, 34, -59]
    assert sent == pytest.approx(arm.transmission.tau(units), abs=1e-12)


def test_torques_the_bus_refused_are_not_reported_as_sent():
    rig, arm = started()
    first = arm.send(TAU, ZERO)
    rig.link.send = broken
    assert arm.send(2 * TAU, ZERO) == pytest.approx(first, abs=1e-12)


def test_safety_mode_is_polled_at_its_period():
    rig, arm = started()
    for _ in range(100):
        cycle(rig, arm, ZERO)
    assert frames(rig).count(GET_MODE) == 4
    assert arm.safety_mode() is SafetyMode.IDLE


def test_activation_is_noticed_within_a_few_cycles():
    rig, arm = started()
    for _ in range(5):
        cycle(rig, arm, ZERO)
    rig.network.pendant("activate")
    for _ in range(3):
        cycle(rig, arm, ZERO)
    assert arm.safety_mode() is SafetyMode.ACTIVE


def test_an_e_stop_is_noticed_while_no_torque_is_sent():
    rig, arm = started()
    cycle(rig, arm, ZERO)
    rig.network.pendant("estop")
    for _ in range(30):
        cycle(rig, arm)
    assert arm.safety_mode() is SafetyMode.E_STOP


def without_broadcast(rig):
    """Suppress the broadcasts of the safety module."""
    due = rig.network.due
    rig.network.due = lambda t_ns: [f for f in due(t_ns) if f[1] != 0x540]


def lose_mode_requests(rig, count):
    """Lose the next `count` requests of the safety mode."""
    receive = rig.network.receive
    left = [count]

    def deaf(t_ns, can_id, data):
        if (can_id, bytes(data)) == GET_MODE and left[0]:
            left[0] -= 1
        else:
            receive(t_ns, can_id, data)

    rig.network.receive = deaf


@pytest.mark.parametrize("lost", [0, 1, 2])
@pytest.mark.parametrize("phase", [1, 2, 13, 24, 25, 26])
def test_an_e_stop_is_detected_within_a_few_incomplete_cycles(phase, lost):
    rig, arm = started()
    rig.network.pendant("activate")
    for _ in range(phase):
        cycle(rig, arm, ZERO)
    without_broadcast(rig)
    lose_mode_requests(rig, lost)
    rig.network.pendant("estop")
    while (reading := arm.read(rig.clock.t_ns)).missing_cycles < 4:
        rig.clock.sleep_until(reading.host_ns + CYCLE_NS)
        if arm.safety_mode() is SafetyMode.E_STOP:
            break
    assert reading.missing_cycles == min(2 + lost, 4)
    assert arm.safety_mode() is SafetyMode.E_STOP


def test_a_lasting_gap_does_not_flood_the_safety_module():
    rig, arm = started()
    cycle(rig, arm, ZERO)
    rig.network.silence(3)
    rig.sent.clear()
    for _ in range(50):
        cycle(rig, arm)
    # Three at once, then in time: every 25 cycles.
    assert frames(rig).count(GET_MODE) == 5


def test_a_bus_that_falls_silent_keeps_its_mode_until_the_guard_has_acted():
    rig, arm = started()
    rig.network.pendant("activate")
    for _ in range(3):
        cycle(rig, arm, ZERO)
    for node in (*range(1, 8), 10):
        rig.network.silence(node)
    # The guard goes to idle after 25 incomplete cycles of a powered arm.
    modes = [(cycle(rig, arm), arm.safety_mode())[1] for _ in range(150)]
    assert set(modes[:30]) == {SafetyMode.ACTIVE}
    assert modes[-1] is SafetyMode.UNKNOWN


def test_a_safety_module_that_falls_silent_becomes_unknown():
    rig, arm = started()
    rig.network.silence(10)
    for _ in range(150):
        cycle(rig, arm, ZERO)
    assert arm.safety_mode() is SafetyMode.UNKNOWN


def test_idle_is_confirmed_before_zero_torque_is_sent():
    rig, arm = started()
    rig.network.pendant("activate")
    cycle(rig, arm, TAU)
    rig.sent.clear()
    assert arm.idle()
    order = frames(rig)
    zeros = [i for i, (can_id, _) in enumerate(order) if can_id in (0x401, 0x402)]
    asked = [(node, GET_MODE[1]) for node in MOTOR_NODES]
    assert order[:9] == [SAFETY_TO_IDLE, GET_MODE, *asked]
    assert zeros == [9, 10]
    assert decode_torques(order[9][1]) == (0, 0, 0, 0)
    assert rig.network.safety_mode is SafetyMode.IDLE


def test_without_confirmation_no_zero_torque_is_sent():
    rig, arm = started()
    rig.network.silence(10)
    assert not arm.idle()
    assert not any(can_id in (0x401, 0x402) for can_id, _ in frames(rig))
    assert arm.safety_mode() is SafetyMode.UNKNOWN


def test_idle_and_close_are_idempotent():
    _, arm = started()
    assert arm.idle()
    assert arm.idle()
    arm.close()
    arm.close()
    assert arm.idle()


def test_idle_on_a_dead_bus_is_unconfirmed_and_does_not_raise():
    rig, arm = started()
    rig.link.send = broken
    assert not arm.idle()
    assert not arm.idle()


def test_positions_are_defined_while_speed_faults_are_ignored():
    rig, arm = started(NetworkOptions(is_zeroed=False), counts=(500,) * 7)
    arm.define_position(HOME)
    writes = [f for f in frames(rig) if len(f[1]) == 6]
    assert [f"{i:03x} {d.hex(' ')}" for i, d in writes] == [
        "00a b7 00 05 00 00 00",
        "001 b0 00 00 00 00 00",
        "002 b0 00 1f 70 ff ff",
        "003 b0 00 e0 8f 00 00",
        "004 b0 00 88 70 ff ff",
        "005 b0 00 00 00 00 00",
        "006 b0 00 00 00 00 00",
        "007 b0 00 00 00 00 00",
        "00a aa 00 01 00 00 00",
    ]
    reading = cycle(rig, arm)
    assert reading.is_complete
    assert reading.q == pytest.approx(HOME, abs=1.2e-4)  # one count of floor


def test_positions_are_not_defined_while_active():
    rig, arm = started()
    rig.network.pendant("activate")
    with pytest.raises(PreflightError, match="ACTIVE"):
        arm.define_position(HOME)
    assert not any(data[0] == 0xB0 for _, data in frames(rig))


def test_a_puck_that_withholds_its_position_fails_the_start():
    rig = Rig()
    arm = WamArm(rig.link, rig.clock)
    send = rig.link.send
    rig.link.send = lambda i, d: None if (i, d) == GET_P else send(i, d)
    with pytest.raises(LinkTimeoutError, match="Pucks 1,2,3,4,5,6,7 do not report"):
        arm.start()


def test_a_dead_bus_fails_the_start_as_a_link_error():
    rig = Rig()
    rig.link.send = broken
    with pytest.raises(LinkError):
        WamArm(rig.link, rig.clock).start()


def test_an_arm_that_is_only_listened_to_is_braked_by_its_own_module():
    rig, arm = started()
    rig.network.pendant("activate")
    rig.network.disobey()
    for _ in range(40):
        cycle(rig, arm, ZERO)
    rig.sent.clear()
    for _ in range(60):
        reading = arm.listen(rig.clock.t_ns)
        rig.rest(CYCLE_NS)
    assert (reading.fresh, reading.is_complete) == (0, False)
    assert GET_P not in frames(rig)
    assert rig.network.safety_mode is SafetyMode.IDLE
    assert arm.safety_mode() is SafetyMode.IDLE


@pytest.mark.parametrize("node", [0, 3, 8, 20, 31])
def test_another_master_with_any_node_is_reported(node):
    rig, arm = started(NetworkOptions(heartbeat_ns=10_000_000_000))
    rig.network.pendant("activate")
    cycle(rig, arm, TAU)
    assert cycle(rig, arm, TAU).foreign_id is None
    rig.network.other_master.join(node)
    rig.rest(CYCLE_NS)
    assert rig.motors.units == [0] * 7  # the pucks obey it
    assert cycle(rig, arm, TAU).foreign_id == 0x401 | node << 5


@pytest.mark.parametrize("joint", [0, 2, 5, 6])
@pytest.mark.parametrize(
    ("turned", "is_taken"), [(0.99 * HOME_LIMIT, True), (1.01 * HOME_LIMIT, False)]
)
def test_zeroing_a_moving_arm_is_refused_with_the_joint(joint, turned, is_taken):
    rig, arm = started(NetworkOptions(is_zeroed=False), counts=(500,) * 7)
    motors = arm.transmission.counts(np.eye(7)[joint] * turned)
    send = rig.link.send

    def send_and_move(can_id, data):
        send(can_id, data)
        if (can_id, data[0]) == (7, 0xB0):
            rig.rest(CYCLE_NS)
            rig.motors.position = [500 + count for count in motors]

    rig.link.send = send_and_move
    if is_taken:
        arm.define_position(HOME)
        assert arm.safety.is_zeroed()
        return
    with pytest.raises(DeviceFaultError, match=f"joint {joint + 1} is 0.03"):
        arm.define_position(HOME)
    assert not arm.safety.is_zeroed()


def test_a_reported_idle_is_not_believed_against_a_driven_puck():
    rig, arm = started()
    rig.network.pendant("activate")
    for _ in range(40):
        cycle(rig, arm, TAU)
    driven = list(rig.motors.units)
    rig.network.disobey()
    rig.network.report_false_idle()
    assert arm.idle() is False
    assert arm.safety_mode() is SafetyMode.ACTIVE
    assert rig.motors.units == driven  # without torque it would fall
    for _ in range(60):
        arm.listen(rig.clock.t_ns)
        rig.rest(CYCLE_NS)
    assert rig.network.safety_mode is SafetyMode.IDLE  # by its own heartbeat
    assert arm.safety_mode() is SafetyMode.IDLE


def test_a_reported_idle_is_not_believed_while_positions_are_requested():
    rig, arm = started()
    rig.network.pendant("activate")
    rig.network.disobey()
    rig.network.report_false_idle()
    arm.idle()
    for _ in range(200):
        cycle(rig, arm, TAU)
    assert rig.network.safety_mode is SafetyMode.ACTIVE
    assert arm.safety_mode() is not SafetyMode.IDLE


def test_a_reported_idle_is_believed_if_the_puck_is_silent():
    rig, arm = started()
    rig.network.pendant("activate")
    cycle(rig, arm, TAU)
    rig.network.silence(2)
    assert arm.idle() is True


def test_each_cycle_of_a_dead_bus_counts_once_while_listening():
    rig, arm = started()
    rig.link.receive = broken
    for _ in range(3):
        arm.listen(rig.clock.t_ns)
    assert arm.counters.link_errors == 3
