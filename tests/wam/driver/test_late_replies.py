"""Replies to an earlier request look timely until a cycle sends no request."""

from itertools import pairwise

import numpy as np
import pytest

from acquisition.errors import LinkTimeoutError
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.frames import MOTOR_NODES, position_reply_id
from wam.driver.arm import WamArm
from wam.driver.settings import ArmSettings

CYCLE_NS = 2_000_000
EVERY = ArmSettings().request_free_every
ZERO = np.zeros(7)
ALL = 0x7F
GET_P = (0x404, b"\x30")
TORQUES = 0x401


class Bench:
    """An arm read at 500 Hz whose replies can be delayed."""

    def __init__(self, **settings):
        self.rig = Rig(NetworkOptions(heartbeat_ns=10_000_000_000))
        settings = ArmSettings(**settings)
        self.arm = WamArm(self.rig.link, self.rig.clock, settings)
        self.arm.start()
        self.rig.network.pendant("activate")
        self.rig.sent.clear()

    def run(self, cycles):
        readings = []
        for _ in range(cycles):
            reading = self.arm.read(self.rig.clock.t_ns)
            if reading.is_complete:
                self.arm.send(ZERO, ZERO)
            readings.append(reading)
            self.rig.clock.sleep_until(reading.host_ns + CYCLE_NS)
        return readings

    def delay(self, nodes, late_ms):
        for node in nodes:
            self.rig.network.faults.delay(
                position_reply_id(node), round(late_ms * 1e6), None
            )


def cycles_without_request(readings):
    return [i for i, reading in enumerate(readings) if reading.is_without_request]


EVERY_PHASE = [1.95, 2.0, 2.3, 2.6, 3.3, 3.6, 3.95, 4.0, 4.6, 5.3, 5.9]


@pytest.mark.parametrize(
    ("nodes", "late_ms"),
    [
        *((tuple(MOTOR_NODES), late_ms) for late_ms in EVERY_PHASE),
        *(((7,), late_ms) for late_ms in (1.95, 3.3, 5.9)),
        *(((1,), 2.0), ((3, 6), 2.6)),
    ],
)
def test_permanently_late_replies_are_detected_or_missing(nodes, late_ms):
    bench = Bench()
    bench.delay(nodes, late_ms)
    readings = bench.run(4 * EVERY)
    late = [r.late for r in readings if r.late is not None]
    motors = sum(1 << (node - 1) for node in nodes)
    if not late:  # between give-up and the next request: no reading is ever complete
        assert max(r.missing_cycles for r in readings) > 3 * EVERY
        return
    assert len(late) >= 3
    assert {r.motors for r in late} == {motors}
    assert [r.in_a_row for r in late] == list(range(1, len(late) + 1))
    assert all(r.age_ns > CYCLE_NS for r in late)
    assert bench.arm.counters.late == len(late) * len(nodes)


@pytest.mark.parametrize("before", range(1, 6))
def test_no_request_is_skipped_while_positions_are_rejected(before):
    bench = Bench()
    bench.run(EVERY - 1 - before)
    bench.rig.motors.position[2] += 1_000_000
    readings = bench.run(30)
    assert [r.missing_cycles for r in readings] == list(range(1, 31))
    assert cycles_without_request(readings) == []


@pytest.mark.parametrize("late_ms", [1.95, 2.0, 2.6, 3.95, 5.9])
def test_late_replies_look_timely_until_a_request_is_skipped(late_ms):
    bench = Bench()
    bench.delay([7], late_ms)
    readings = bench.run(EVERY - 1)
    assert all(reading.is_complete for reading in readings[5:])
    (reading,) = bench.run(1)
    assert reading.late is not None


def test_no_reply_of_a_sound_arm_is_late():
    bench = Bench()
    readings = bench.run(10 * EVERY)
    assert len(cycles_without_request(readings)) == 10
    assert not any(reading.late for reading in readings)
    assert bench.arm.counters.late == 0


def test_a_cycle_without_a_request_still_sends_torques():
    bench = Bench()
    readings = bench.run(3 * EVERY)
    assert cycles_without_request(readings) == [EVERY - 1, 2 * EVERY - 1, 3 * EVERY - 1]
    sent = [(i, d) for _, i, d in bench.rig.sent]
    assert sent.count(GET_P) == 3 * EVERY - 3
    assert sum(can_id == TORQUES for can_id, _ in sent) == 3 * EVERY


def test_a_cycle_without_a_request_is_not_counted_as_missing():
    bench = Bench()
    readings = bench.run(EVERY)
    assert readings[-1].is_without_request
    assert all(r.is_complete and r.fresh == ALL for r in readings)
    assert all(r.missing_cycles == 0 for r in readings)
    assert bench.arm.counters.missing == [0] * 7
    assert bench.arm.counters.rejected == 0


def test_positions_are_extrapolated_in_a_cycle_without_a_request():
    bench = Bench()
    turning = []
    for _ in range(EVERY + 2):
        bench.rig.motors.position[6] += 20
        turning += bench.run(1)
    steps = [b.q[6] - a.q[6] for a, b in pairwise(turning)]
    assert turning[EVERY - 1].is_without_request
    # To half a count: the others are whole ones.
    assert steps[EVERY - 2] == pytest.approx(steps[EVERY - 3], rel=0.03)
    assert turning[EVERY - 1].counts[6] == turning[EVERY - 2].counts[6]


def test_a_single_late_reply_is_not_permanent_lateness():
    bench = Bench()
    bench.run(EVERY - 2)
    bench.rig.network.faults.delay(position_reply_id(6), 1_950_000)
    missed, next_one, then = bench.run(3)
    assert not missed.is_complete
    # While a reply is outstanding every cycle sends a request.
    assert not next_one.is_without_request
    assert then.is_without_request
    assert then.late is None


@pytest.mark.parametrize("late_ms", [2.0, 3.95, 5.9])
def test_lateness_is_confirmed_soon_after_its_first_sign(late_ms):
    bench = Bench()
    bench.delay(MOTOR_NODES, late_ms)
    readings = bench.run(EVERY + 12)
    at = [i for i, reading in enumerate(readings) if reading.late]
    assert at == [EVERY - 1, EVERY + 4, EVERY + 9]


def test_the_lateness_count_restarts_once_replies_are_timely():
    bench = Bench()
    bench.delay([7], 2.0)
    first = [r.late.in_a_row for r in bench.run(EVERY + 6) if r.late]
    bench.rig.network.faults.clear_faults()
    bench.run(EVERY)
    bench.delay([7], 2.0)
    again = [r.late.in_a_row for r in bench.run(EVERY) if r.late]
    assert (first, again[0]) == ([1, 2], 1)


def test_late_replies_are_counted_in_the_metadata():
    bench = Bench()
    bench.delay([7], 2.0)
    bench.run(EVERY)
    assert bench.arm.counters.metadata()["link:replies_to_earlier_cycles"] == "1"


def test_another_device_on_the_bus_is_polled_in_every_cycle():
    bench, asked = Bench(), []

    class Companion:
        def poll_frame(self, t_ns):
            asked.append(t_ns)
            return 8, b"\x36"

        def on_frame(self, can_id, data):
            pass

    bench.arm.attach_device(Companion())
    assert len(cycles_without_request(bench.run(EVERY))) == 1
    assert len(asked) == EVERY


def test_a_start_reports_late_positions_as_late_and_not_missing():
    rig = Rig()
    arm = WamArm(rig.link, rig.clock)
    for node in MOTOR_NODES:
        rig.network.faults.delay(position_reply_id(node), 3_950_000, None)
    with pytest.raises(LinkTimeoutError, match=r"in time: \d+ replies came after"):
        arm.start()


def test_a_cycle_without_a_request_waits_little_longer_than_an_exchange():
    """The last reply arrives after 0.6 ms; the driver waits for 1.5 ms."""
    bench = Bench(first_read_ns=100_000)
    bench.run(EVERY - 1)
    begun_ns = bench.rig.clock.t_ns
    assert bench.arm.read(begun_ns).is_without_request
    assert 700_000 < bench.rig.clock.t_ns - begun_ns < 1_000_000
