"""Properties read at the start are polled again while the arm is driven."""

import numpy as np
import pytest

from acquisition.devices import MotorChange
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.frames import MOTOR_NODES
from wam.driver.arm import WamArm
from wam.driver.property_watch import WATCHED, PropertyWatch
from wam.driver.settings import ArmSettings

CYCLE_NS = 2_000_000
EVERY = ArmSettings().watch_poll_cycles
TURN = EVERY * len(WATCHED) * len(MOTOR_NODES)  # cycles until all were polled
ZERO = np.zeros(7)


class Bench:
    def __init__(self, **options):
        self.rig = Rig(NetworkOptions(heartbeat_ns=10_000_000_000, **options))
        self.arm = WamArm(self.rig.link, self.rig.clock)
        self.arm.start()
        self.rig.sent.clear()

    def run(self, cycles):
        for _ in range(cycles):
            reading = self.arm.read(self.rig.clock.t_ns)
            self.arm.send(ZERO, ZERO)
            self.rig.clock.sleep_until(reading.host_ns + CYCLE_NS)
        return reading


@pytest.mark.parametrize(
    ("node", "name", "was", "value"),
    [(3, "PIDX", 3, 2), (2, "MT", 4860, 700), (7, "IPNM", 17474, 2700)],
)
def test_a_changed_property_is_reported_with_both_values(node, name, was, value):
    bench = Bench()
    assert bench.run(10).change is None
    bench.rig.network.set_property(node, name, value)
    assert bench.run(TURN + 50).change == MotorChange(node, name, was, value)


def test_the_first_change_stays_reported_after_the_value_reverts():
    bench = Bench()
    bench.rig.network.set_property(2, "MT", 700)
    first = MotorChange(2, "MT", 4860, 700)
    assert bench.run(TURN + 50).change == first
    bench.rig.network.set_property(2, "MT", 4860)
    bench.rig.network.set_property(1, "IPNM", 2600)
    assert bench.run(TURN + 50).change == first


def test_another_start_resets_the_watch():
    bench = Bench()
    bench.rig.network.set_property(7, "MT", 1400)
    assert bench.run(TURN + 50).change is not None
    bench.arm.start()
    assert bench.run(TURN + 50).change is None


@pytest.mark.parametrize("vers", [65, 128, 200])
def test_all_properties_are_polled_in_turn_without_false_changes(vers):
    bench = Bench(vers=(vers,) * 7)
    assert bench.run(TURN + 100).change is None
    asked = {(i, d) for _, i, d in bench.rig.sent if i in MOTOR_NODES and len(d) == 1}
    # Of each puck the watched ones, four of telemetry (TEMP, THERM, VBUS, ERROR), MODE
    # and T.
    assert len(asked) == (len(WATCHED) + 4 + 2) * len(MOTOR_NODES)


def test_no_cycle_has_two_requests():
    bench = Bench()
    bench.run(TURN)
    nodes = (*MOTOR_NODES, 10)
    times = [t for t, i, d in bench.rig.sent if i in nodes and len(d) == 1]
    assert len({t // CYCLE_NS for t in times}) == len(times)


def questions(watch, count):
    return {watch.next_question() for _ in range(count)}


def test_an_even_number_of_requests_is_also_polled_in_turn():
    watch = PropertyWatch()
    answers = [dict.fromkeys(WATCHED, 1)] * 6
    watch.begin([*answers, dict.fromkeys(WATCHED[1:], 1)], (200,) * 7)
    count = len(WATCHED) * 7 - 1
    assert len(questions(watch, count)) == count


def test_every_start_polls_from_the_first_property():
    watch = PropertyWatch()
    for _ in range(2):
        watch.begin([dict.fromkeys(WATCHED, 1)] * 7, (200,) * 7)
        nodes = [watch.next_question()[0] for _ in range(9)]
        assert nodes == [1, 2, 3, 4, 5, 6, 7, 1, 2]


def test_a_single_property_is_polled_repeatedly():
    watch = PropertyWatch()
    watch.begin([{}] * 6 + [{"MT": 1370}], (200,) * 7)
    assert len(questions(watch, 3)) == 1


def test_nothing_is_polled_before_a_start_or_of_silent_pucks():
    watch = PropertyWatch()
    assert watch.next_question() is None
    watch.begin([dict.fromkeys(WATCHED)] * 7, (200,) * 7)
    assert watch.next_question() is None


def test_a_property_no_longer_answered_is_not_polled_after_a_restart():
    watch = PropertyWatch()
    for count in (7, 6):
        watch.begin([{"MT": 1370}] * count + [{}] * (7 - count), (200,) * 7)
    assert {node for node, _ in questions(watch, 7)} == {1, 2, 3, 4, 5, 6}
