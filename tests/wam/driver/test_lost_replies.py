"""Missing, late, doubled and wrong replies are counted and give no wrong position."""

import numpy as np
import pytest

from acquisition.devices import BusCondition
from acquisition.errors import PreflightError
from acquisition.sample import Flag, reading_bits
from fakes.pucks.bus_faults import BusFaults
from fakes.pucks.options import NetworkOptions
from fakes.world.faults import network_faults
from tests.fakes.stepped import Rig
from wam.bus.frames import MOTOR_NODES, position_reply_id
from wam.driver.arm import WamArm
from wam.driver.settings import ArmSettings

HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
ZERO = np.zeros(7)
CYCLE_NS = 2_000_000
STEP = 20  # counts that each motor moves in a cycle
# A reply with this delay arrives between the next request and its reply.
ALMOST_A_CYCLE_NS = 1_950_000


class Bench:
    """An arm whose motors move steadily, read every 2 ms.

    Attributes:
        took_ns: how long the last reading took.
    """

    def __init__(self, **settings) -> None:
        options = NetworkOptions(heartbeat_ns=100_000_000_000)
        self.rig = Rig(options, HOME_COUNTS)
        self.arm = WamArm(self.rig.link, self.rig.clock, ArmSettings(**settings))
        self.arm.start()
        self.took_ns = 0
        self.faults: BusFaults = self.rig.network.faults

    def cycle(self):
        rig = self.rig
        rig.motors.position = [p + STEP for p in rig.motors.position]
        reading = self.arm.read(rig.clock.t_ns)
        self.took_ns = rig.clock.t_ns - reading.host_ns
        if reading.is_complete:
            self.arm.send(ZERO, ZERO)
        rig.clock.sleep_until(reading.host_ns + CYCLE_NS)
        return reading

    def is_true(self, reading):
        return list(reading.counts) == list(self.rig.motors.position)


@pytest.fixture
def bench():
    return Bench()


def test_missing_replies_are_counted_for_each_puck(bench):
    bench.faults.drop(position_reply_id(2), 3)
    bench.faults.drop(position_reply_id(7), 1)
    readings = [bench.cycle() for _ in range(5)]
    assert bench.arm.counters.missing == [0, 3, 0, 0, 0, 0, 1]
    assert [r.missing_cycles for r in readings] == [1, 2, 3, 0, 0]
    fields = bench.arm.counters.metadata()
    assert fields["link:missing_replies"] == "0 3 0 0 0 0 1"
    assert "link:missing_replies 0 3 0 0 0 0 1" in bench.arm.counters.text()


# Puck 1 answers first and puck 7 last, when the others are complete already; the
# driver may read before or after the arrival of all replies.
@pytest.mark.parametrize("node", [1, 4, 7])
@pytest.mark.parametrize("first_read_ns", [100_000, 700_000])
def test_a_late_reply_is_never_taken_for_the_next_one(node, first_read_ns):
    bench = Bench(first_read_ns=first_read_ns)
    bench.cycle()
    bench.faults.delay(position_reply_id(node), ALMOST_A_CYCLE_NS)
    late = bench.cycle()
    assert late.fresh == 0b1111111 & ~(1 << node - 1)
    following = bench.cycle()
    assert following.is_complete
    assert bench.is_true(following)
    assert bench.arm.counters.stale == 1
    assert bench.is_true(bench.cycle())
    assert bench.arm.counters.stale == 1


def test_a_reply_that_comes_after_its_cycle_is_drained_before_the_next(bench):
    bench.faults.delay(position_reply_id(3), 1_700_000)
    assert not bench.cycle().is_complete
    assert bench.is_true(bench.cycle())
    assert bench.arm.counters.stale == 1
    assert bench.took_ns < 1_000_000  # no reply is outstanding, none is awaited


def test_a_lost_reply_costs_only_the_wait_of_its_cycle(bench):
    bench.faults.drop(position_reply_id(3))
    bench.cycle()
    taken = [(bench.is_true(bench.cycle()), bench.took_ns) for _ in range(3)]
    assert taken == [(True, 1_500_000), (True, 700_000), (True, 700_000)]
    assert bench.arm.counters.stale == 0


def test_a_doubled_reply_is_counted_and_changes_nothing(bench):
    bench.faults.duplicate(position_reply_id(3), None)
    readings = [bench.cycle() for _ in range(5)]
    assert all(r.is_complete for r in readings)
    assert bench.is_true(readings[-1])
    assert bench.arm.counters.stale >= 4  # the last one may still be on the wire


@pytest.mark.parametrize(
    ("node", "after_ns"),
    [*((node, 50_000) for node in MOTOR_NODES), (1, 0), (7, 1_000_000)],
)
def test_a_second_sender_is_detected_within_a_few_cycles(bench, node, after_ns):
    bench.faults.answer_twice(position_reply_id(node), lambda data: data, after_ns)
    doubled = [bench.cycle().doubled for _ in range(10)]
    assert doubled[0] == 0
    assert doubled[-1] == node


@pytest.mark.parametrize("after_ns", [0, 50_000, 1_000_000])
def test_an_arm_with_a_duplicated_puck_is_not_started(bench, after_ns):
    bench.faults.answer_twice(position_reply_id(5), lambda data: data, after_ns)
    with pytest.raises(PreflightError, match="Puck 5 sends more replies"):
        bench.arm.start()


def test_swapped_replies_do_not_change_positions(bench):
    network_faults(bench.rig.network)["reply-swapped"]()
    incomplete = 0
    for _ in range(210):
        reading = bench.cycle()
        incomplete += not reading.is_complete
        if not reading.is_without_request:
            assert bench.is_true(reading) is reading.is_complete
        assert reading.missing_cycles <= 1
    assert incomplete == 4  # puck 6 is one request late every 50 requests
    assert bench.arm.counters.rejected == 0


@pytest.mark.parametrize("byte", [0, 1])
def test_a_corrupted_position_is_rejected(bench, byte):
    for _ in range(3):
        bench.cycle()
    bench.faults.corrupt(position_reply_id(3), byte)
    reading = bench.cycle()
    assert reading.fresh == 0b1111011
    counters = bench.arm.counters
    assert counters.rejected + counters.malformed == 1
    assert bench.is_true(bench.cycle())


def test_heavy_foreign_bus_traffic_costs_no_cycle(bench):
    network_faults(bench.rig.network)["bus-flooded"]()
    readings = [bench.cycle() for _ in range(500)]
    assert all(r.is_complete for r in readings)
    latest = max(r.arm_ns - r.host_ns for r in readings)
    assert 1_000_000 < latest < 1_500_000  # later than on a quiet bus, but in time


def test_an_interface_that_goes_down_is_reported_and_recovers(bench):
    bench.cycle()
    bench.faults.go_down()
    assert bench.cycle().fresh == 0
    assert bench.arm.bus_condition is BusCondition.DOWN
    assert bench.arm.counters.link_errors > 0
    bench.faults.clear_faults()
    reading = bench.cycle()
    assert reading.is_complete
    assert bench.is_true(reading)
    assert bench.arm.bus_condition is BusCondition.SOUND


def test_a_bus_off_controller_is_reported_until_the_arm_answers(bench):
    bench.cycle()
    bench.faults.go_off()
    assert bench.cycle().fresh == 0
    assert bench.arm.bus_condition is BusCondition.OFF
    assert bench.arm.counters.link_errors == 0  # nothing was refused
    bench.faults.clear_faults()
    assert bench.cycle().is_complete
    assert bench.arm.bus_condition is BusCondition.SOUND
    assert "bus-off 1" in bench.arm.counters.metadata()["link:error_frames"]


def test_an_unacknowledged_host_fills_its_queue(bench):
    bench.cycle()
    bench.faults.stop_acknowledging()
    seen = {bench.arm.bus_condition for _ in range(15) if not bench.cycle().is_complete}
    assert seen == {BusCondition.UNACKNOWLEDGED, BusCondition.FULL}


def test_no_torque_is_queued_while_frames_are_unacknowledged(bench):
    bench.cycle()
    bench.faults.stop_acknowledging()
    for _ in range(30):
        bench.cycle()
    heard = []
    receive = bench.rig.network.receive
    bench.rig.network.receive = lambda *frame: (heard.append(frame[1]), receive(*frame))
    bench.faults.clear_faults()
    before_ns = bench.rig.clock.t_ns
    bench.arm.read(before_ns)  # queued frames leave before it
    assert heard.count(0x404) > 5
    assert not {0x401, 0x402} & set(heard)


@pytest.mark.parametrize("is_silent", [True, False])
def test_no_torque_follows_unsent_frames_while_motors_are_silent(bench, is_silent):
    bench.cycle()
    bench.rig.link.has_unsent = lambda: True
    if is_silent:
        bench.faults.drop(position_reply_id(2), 1)
    bench.rig.sent.clear()
    bench.arm.read(bench.rig.clock.t_ns)
    before = bench.arm.sent_ns
    bench.arm.send(ZERO, ZERO)
    torques = [can_id for _, can_id, _ in bench.rig.sent if can_id in {0x401, 0x402}]
    assert torques == ([] if is_silent else [0x401, 0x402])
    assert (bench.arm.sent_ns == before) == is_silent
    withheld = bench.arm.counters.metadata()["link:withheld_torques"]
    assert withheld == ("1" if is_silent else "0")


def test_the_bus_time_of_a_reading_is_that_of_its_last_reply(bench):
    reading = bench.cycle()
    assert reading.host_ns < reading.bus_ns <= reading.arm_ns
    bench.faults.drop(position_reply_id(7), 1)
    assert bench.cycle().bus_ns < bench.rig.clock.t_ns
    bench.faults.is_down = True
    assert bench.cycle().bus_ns == 0


def test_a_recording_states_its_transport(bench):
    fields = bench.arm.counters.metadata()
    assert (fields["link:door"], fields["link:lost_frames"]) == ("python-can", "0")


def test_a_controller_error_marks_only_the_reading_of_its_cycle(bench):
    assert not bench.cycle().has_bus_error
    bench.faults.report_error(0x004, bytes((0, 4, 0, 0, 0, 0, 0, 0)))
    reading = bench.cycle()
    assert reading.has_bus_error
    assert reading_bits(reading, is_late=False) & Flag.BUS_ERROR
    after = bench.cycle()
    assert not after.has_bus_error
    assert not reading_bits(after, is_late=False) & Flag.BUS_ERROR
    assert bench.arm.counters.metadata()["link:error_frames"] == "warning 1"
    assert bench.arm.bus_condition is BusCondition.SOUND


def test_idle_is_confirmed_when_the_bus_comes_back_in_time(bench):
    bench.rig.network.pendant("activate")
    bench.cycle()
    bench.faults.go_down()
    advance = bench.rig.bus.advance
    back_ns = bench.rig.clock.t_ns + 20_000_000

    def coming_back(t_ns):
        if t_ns >= back_ns:
            bench.faults.clear_faults()
        advance(t_ns)

    bench.rig.bus.advance = coming_back
    assert bench.arm.idle()


def test_idle_on_a_bus_that_stays_off_ends_in_unknown(bench):
    bench.rig.network.pendant("activate")
    bench.cycle()
    bench.faults.go_down()
    begin_ns = bench.rig.clock.t_ns
    assert not bench.arm.idle()
    # As long as the arm's own heartbeat allows, and no longer.
    assert 100_000_000 <= bench.rig.clock.t_ns - begin_ns <= 120_000_000


def test_a_single_restarted_puck_clears_the_zero(bench):
    bench.rig.network.reboot(3)
    again = WamArm(bench.rig.link, bench.rig.clock)
    assert not again.start().is_zeroed
    # Awake by now, it looks like the others: the module has to remember.
    assert not WamArm(bench.rig.link, bench.rig.clock).start().is_zeroed


def test_a_rejected_motor_keeps_its_last_position(bench):
    for _ in range(60):
        before = bench.cycle()
    bench.faults.corrupt(position_reply_id(7), 1)
    reading = bench.cycle()
    assert reading.counts[6] == before.counts[6]
    assert reading.q[6] == pytest.approx(before.q[6], abs=1e-12)
    assert (reading.jump.motor, before.jump) == (7, None)
    turn = 2 * np.pi / 4096 / 14.93  # rad per count
    speed = abs(reading.jump.counts) * turn / (CYCLE_NS * 1e-9)
    assert reading.jump.speed == pytest.approx(speed, rel=1e-6)
    assert bench.cycle().jump is None


@pytest.mark.parametrize("how", ["listen", "skip"])
def test_an_interface_that_is_down_is_reported_without_position_requests(bench, how):
    assert bench.cycle().arm_ns > 0
    bench.faults.go_down()
    errors = bench.arm.counters.link_errors
    reading = getattr(bench.arm, how)(bench.rig.clock.t_ns)
    assert (reading.arm_ns, reading.bus_ns) == (0, 0)
    assert bench.arm.bus_condition is BusCondition.DOWN
    assert bench.arm.counters.link_errors > errors


def test_each_refused_frame_is_counted(bench):
    bench.cycle()
    bench.faults.go_down()
    errors = bench.arm.counters.link_errors
    bench.arm.read(bench.rig.clock.t_ns)
    asked = bench.arm.counters.link_errors
    bench.arm.send(ZERO, ZERO)
    assert asked == errors + 2  # the request for positions and that for the mode
    assert bench.arm.counters.link_errors > asked
