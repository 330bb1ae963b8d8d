"""The driver polls mode, monitors and telemetry in the free bus time."""

from collections import Counter

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.frames import encode_reply, encode_set, property_reply_id
from wam.bus.properties import PuckMode
from wam.driver.arm import WamArm
from wam.driver.health import (
    PuckHealth,
    health_metadata,
    health_warnings,
    temperature_range,
)
from wam.driver.pendant import NO_PENDANT
from wam.driver.settings import ArmSettings
from wam.driver.status_poller import StatusPoller

ZERO = np.zeros(7)
CYCLE_NS = 2_000_000
S = 1_000_000_000
HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
GET_MODE, GET_PEN = (0x00A, b"\x08"), (0x00A, b"\x2b")
HEALTH = [bytes((p,)) for p in (9, 20, 21, 4)]
SET_IDLE = (0x00A, bytes.fromhex("88 00 01 00 00 00"))
POSITIONS_AND_TORQUES = {0x404, 0x401, 0x402}


class Bench:
    def __init__(self):
        # A heartbeat longer than any test.
        self.rig = Rig(NetworkOptions(heartbeat_ns=10_000_000_000), HOME_COUNTS)
        self.arm = WamArm(self.rig.link, self.rig.clock)
        self.arm.start()
        self.rig.sent.clear()

    def run(self, cycles, *, is_sending=True):
        """Run; return the requests of each cycle."""
        asked = []
        for _ in range(cycles):
            self.rig.sent.clear()
            reading = self.arm.read(self.rig.clock.t_ns)
            if is_sending:
                self.arm.send(ZERO, ZERO)
            self.rig.clock.sleep_until(reading.host_ns + CYCLE_NS)
            asked.append(
                [(i, d) for _, i, d in self.rig.sent if i not in POSITIONS_AND_TORQUES]
            )
        return asked


@pytest.fixture
def bench():
    return Bench()


@pytest.mark.parametrize("is_sending", [True, False])
def test_a_cycle_has_at_most_one_request(bench, is_sending):
    asked = bench.run(1000, is_sending=is_sending)
    assert max(map(len, asked)) == 1


def test_mode_and_pendant_alternate_and_pucks_have_their_own_period(bench):
    asked = [q for cycle in bench.run(1000) for q in cycle]
    safety = [q for q in asked if q[0] == 0x00A]
    assert safety == [GET_MODE, GET_PEN] * 40
    health = [q for q in asked if q[0] != 0x00A and q[1] in HEALTH]
    assert len(health) == 20
    # Watched properties are polled as often; the remaining requests are of MODE and T.
    held = [q for q in asked if q[0] != 0x00A and q[1] in (b"\x08", b"\x2a")]
    assert len(asked) - len(safety) - len(health) - len(held) == 20
    assert len(held) > 200


def test_every_puck_is_polled_for_telemetry_in_turn(bench):
    asked = [q for cycle in bench.run(28 * 50) for q in cycle if q[0] != 0x00A]
    asked = [q for q in asked if q[1] in HEALTH]
    expected = {(n, bytes((p,))) for n in range(1, 8) for p in (9, 20, 21, 4)}
    assert Counter(asked) == Counter(expected)


def test_the_newest_telemetry_is_kept(bench):
    begin = bench.arm.health()
    assert begin == (PuckHealth(35, 33, 48, 0, begin[0].heard_ns),) * 7
    bench.rig.network.set_bus_voltage(41.0)
    bench.run(28 * 50 + 1)
    end = bench.arm.health()
    assert [p.bus_voltage for p in end] == [41] * 7
    assert all(p.is_recent(bench.rig.clock.t_ns) for p in end)


def test_warnings_and_faults_of_the_pendant_are_reported(bench):
    bench.rig.network.pendant("activate")
    bench.run(30)
    assert (bench.arm.safety_warnings(), bench.arm.safety_faults()) == ((), ())
    bench.rig.network.set_bus_voltage(33.0)
    bench.run(30)
    assert (bench.arm.safety_warnings(), bench.arm.safety_faults()) == (
        ("voltage",),
        (),
    )


def test_a_change_of_mode_is_explained_in_the_cycle_after_it_is_known(bench):
    bench.rig.network.pendant("activate")
    bench.run(3)
    bench.rig.network.receive(bench.rig.clock.t_ns, 0x00A, encode_set(48, 0))  # TL2
    bench.rig.network.receive(
        bench.rig.clock.t_ns, 0x401, bytes.fromhex("aa 00 07 ff f0 00 bf fe")
    )
    bench.run(4)
    assert bench.arm.safety_mode() is SafetyMode.IDLE
    assert bench.arm.safety_faults() == ("torque",)


def test_idle_reads_the_cause_of_a_stop(bench):
    bench.rig.network.pendant("activate")
    bench.run(3)
    bench.rig.network.pendant("estop")
    assert bench.arm.idle()
    assert bench.arm.safety_faults() == ("other",)


def test_an_invalid_word_is_counted_and_ignored(bench, monkeypatch):
    receive = bench.rig.link.receive

    def garble():
        return [
            frame._replace(data=b"\xab\0\0\0\0\0") if frame.data[0] == 0xAB else frame
            for frame in receive()
        ]

    monkeypatch.setattr(bench.rig.link, "receive", garble)
    bench.run(100)
    assert bench.arm.counters.malformed == 4
    assert bench.arm.safety_faults() == ()
    assert bench.arm.idle()


def test_the_mode_is_polled_while_no_torques_are_sent(bench):
    bench.run(5)
    bench.rig.network.pendant("activate")
    bench.run(60, is_sending=False)
    assert bench.arm.safety_mode() is SafetyMode.ACTIVE


def test_an_unconfirmed_idle_is_repeated_until_confirmed(bench):
    bench.rig.network.pendant("activate")
    bench.run(3)
    deaf = bench.rig.network.receive
    bench.rig.network.receive = lambda t, i, d: None if i == 0x00A else deaf(t, i, d)
    assert not bench.arm.idle()
    assert bench.arm.safety_mode() is SafetyMode.UNKNOWN
    bench.run(200, is_sending=False)
    assert bench.rig.network.safety_mode is SafetyMode.ACTIVE
    bench.rig.network.receive = deaf
    asked = [q for cycle in bench.run(40, is_sending=False) for q in cycle]
    assert bench.arm.safety_mode() is SafetyMode.IDLE
    assert asked.count(SET_IDLE) == 1
    assert SET_IDLE not in [
        q for cycle in bench.run(40, is_sending=False) for q in cycle
    ]


def test_a_late_confirmation_of_idle_is_accepted(bench):
    bench.rig.network.pendant("activate")
    bench.run(3)
    bench.rig.network.silence(10)
    assert not bench.arm.idle()
    bench.run(10, is_sending=False)
    assert bench.arm.safety_mode() is SafetyMode.UNKNOWN
    bench.rig.network.silence(10, is_mute=False)
    bench.run(30, is_sending=False)
    assert bench.arm.safety_mode() is SafetyMode.IDLE


def test_temperatures_are_reported_from_coldest_to_hottest():
    pucks = [PuckHealth(31, 36, heard_ns=0), PuckHealth(33, heard_ns=0), PuckHealth()]
    assert temperature_range(pucks, S) == "31-36 °C"
    assert temperature_range([PuckHealth()], S) == "temperatures unknown"


def test_a_silent_puck_is_shown_with_the_age_of_its_last_reply(bench):
    bench.rig.network.silence(3)
    bench.run(7 * 50 * 5)  # five requests to each puck
    now_ns, pucks = bench.rig.clock.t_ns, bench.arm.health()
    assert (pucks[2].puck_degc, pucks[2].is_recent(now_ns)) == (35, False)
    assert temperature_range(pucks, now_ns) == "33-35 °C, puck 3 silent for 4 s"
    fields = health_metadata(pucks, now_ns)
    assert fields["pucks:temperature_degc"] == "35 35 ? 35 35 35 35"
    assert float(fields["pucks:age_s"].split()[2]) > 3.0


def test_a_hot_or_faulty_puck_is_reported():
    pucks = [PuckHealth(61, 30, 48, 0, 0), PuckHealth(60, 30, 48, 7, 0), PuckHealth()]
    expected = ["puck 1 at 61 °C (limit 60)", "puck 2 reports error 7"]
    assert health_warnings(pucks, S) == expected
    assert health_warnings(pucks, 10 * S) == []


def test_telemetry_is_listed_in_the_order_of_the_pucks():
    pucks = [PuckHealth(31, 29, 48, 0, S), PuckHealth(-5, None, 47, 3, 2 * S)]
    assert health_metadata(pucks, 2 * S) == {
        "pucks:age_s": "1.0 0.0",
        "pucks:temperature_degc": "31 -5",
        "pucks:motor_temperature_degc": "29 ?",
        "pucks:bus_voltage": "48 47",
        "pucks:error": "0 3",
    }


def test_the_age_of_the_modules_last_reply_is_known(bench):
    bench.run(30)
    bench.rig.network.silence(10)
    bench.run(1)
    heard_ns = bench.arm.safety_heard_ns
    bench.run(300)
    assert bench.arm.safety_mode() is SafetyMode.UNKNOWN
    assert bench.arm.safety_heard_ns == heard_ns
    assert 600_000_000 <= bench.rig.clock.t_ns - heard_ns <= 660_000_000


def test_an_undefined_mode_is_not_a_reply(bench, monkeypatch):
    receive = bench.rig.link.receive

    def garble():
        return [
            frame._replace(data=b"\x88\0\5\0\0\0") if frame.data[0] == 0x88 else frame
            for frame in receive()
        ]

    bench.run(3)
    before = bench.arm.safety_mode()
    monkeypatch.setattr(bench.rig.link, "receive", garble)
    bench.run(100)
    assert bench.arm.safety_mode() is before
    bench.run(50)
    assert bench.arm.safety_mode() is SafetyMode.UNKNOWN


def test_listening_does_not_wait(bench):
    now_ns = bench.rig.clock.t_ns
    bench.arm.listen(now_ns)
    assert bench.rig.clock.t_ns == now_ns


def test_positions_are_whole_again_after_listening(bench):
    for _ in range(50):
        bench.arm.listen(bench.rig.clock.t_ns)
        bench.rig.rest(2_000_000)
    assert bench.arm.read(bench.rig.clock.t_ns).is_complete


class Bus:
    """A bus on which nothing answers; it keeps what was sent."""

    def __init__(self):
        self.mode_hints, self.sent = 0, []

    def send(self, node, data):
        self.sent.append((node, data))


def poll(poller, cycles, **how):
    for _ in range(cycles):
        poller.begin_cycle(0)
        poller.ask(**how)


PERIOD = ArmSettings().safety_poll_cycles


def test_the_mode_becomes_unknown_after_unanswered_requests():
    bus = Bus()
    poller = StatusPoller(bus, ArmSettings())
    poll(poller, 1)
    poller.note_mode(SafetyMode.ACTIVE, 1)
    poll(poller, 4 * PERIOD)
    assert poller.mode is SafetyMode.ACTIVE
    poll(poller, PERIOD)
    assert poller.mode is SafetyMode.UNKNOWN


def test_a_burst_of_urgent_requests_is_not_silence():
    poller = StatusPoller(Bus(), ArmSettings())
    poll(poller, 1)
    poller.note_mode(SafetyMode.ACTIVE, 1)
    poll(poller, PERIOD - 1, is_urgent=True)
    assert poller.mode is SafetyMode.ACTIVE


def test_a_second_request_waits_for_the_next_cycle():
    bus = Bus()
    poller = StatusPoller(bus, ArmSettings())
    poller.begin_cycle(0)
    poller.ask()
    poller.ask(is_urgent=True)
    assert len(bus.sent) == 1


def test_the_first_cycle_requests_the_mode_and_the_others_are_spread():
    bus = Bus()
    poller = StatusPoller(bus, ArmSettings())
    asked = []
    for _ in range(PERIOD):
        before = len(bus.sent)
        poll(poller, 1)
        asked.append(bus.sent[before:])
    first = [cycle for cycle, questions in enumerate(asked) if questions]
    settings = ArmSettings()
    health = settings.health_poll_cycles // 3 - 1
    assert first[:3] == sorted({0, PERIOD // 2 - 1, health})[:3]


def test_the_pendant_read_at_start_is_known_before_the_first_request():
    bench = Bench()
    bench.rig.network.pendant("activate")
    bench.rig.network.set_bus_voltage(33.0)
    bench.run(30)
    assert bench.arm.safety_warnings() == ("voltage",)

    again = WamArm(bench.rig.link, bench.rig.clock)
    again.start()
    assert again.safety_warnings() == ("voltage",)


def test_a_start_clears_earlier_doubts_and_exempts_ambiguous_monitors():
    poller = StatusPoller(Bus(), ArmSettings())
    poller.is_lowering = True
    poller.contradict([2])
    poller.begin(NO_PENDANT)
    assert (poller.is_lowering, poller.contradicted_by) == (False, set())
    assert poller.excused == NO_PENDANT.inconsistent_monitors != ()


@pytest.mark.parametrize(
    ("node", "reported", "mode", "contradicted_by"),
    [
        (2, PuckMode.IDLE, SafetyMode.IDLE, set()),
        (2, PuckMode.TORQUE, SafetyMode.UNKNOWN, {2}),
        (3, PuckMode.IDLE, SafetyMode.UNKNOWN, {2}),
        (10, SafetyMode.IDLE, SafetyMode.UNKNOWN, {2}),
        (9, SafetyMode.ACTIVE, SafetyMode.UNKNOWN, {2}),  # no node of the arm
    ],
)
def test_only_the_contradicting_puck_resolves_the_contradiction(
    node, reported, mode, contradicted_by
):
    poller = StatusPoller(Bus(), ArmSettings())
    poller.contradict([2])
    poller.on_frame(property_reply_id(node), encode_reply(8, reported, is_wide=False))
    assert (poller.mode, poller.contradicted_by) == (mode, contradicted_by)


def test_an_arm_without_power_contradicts_no_report_of_idle():
    poller = StatusPoller(Bus(), ArmSettings())
    poller.contradict([2])
    for mode in (SafetyMode.E_STOP, SafetyMode.IDLE):
        poller.on_frame(property_reply_id(10), encode_reply(8, mode, is_wide=False))
        assert (poller.mode, poller.contradicted_by) == (mode, set())
