from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import DeviceFaultError, LinkTimeoutError
from fakes.pucks.ft_puck import Load
from fakes.pucks.options import NetworkOptions
from ft_sensor.vendors.barrett import BarrettSensor
from ft_sensor.vendors.barrett_frames import (
    SAMPLING_DELAY_NS,
    BarrettCounters,
    WrenchPairing,
    status_texts,
)
from tests.fakes.stepped import Rig, SteppedClock
from wam.bus.frames import encode_force, encode_torque
from wam.driver.arm import WamArm

MS = 1_000_000
CYCLE_NS = 2 * MS
FORCE_ID, TORQUE_ID = 0x50A, 0x50B
FORCE = bytes.fromhex("00 01 80 fd 31 f6")  # (1.0, -2.5, -9.81) N
TORQUE = bytes.fromhex("9a 01 00 fc 3d 00")  # (0.1, -0.25, 0.015) N m
ZERO = np.zeros(7)


@pytest.fixture
def pairing():
    pairing = WrenchPairing(BarrettCounters())
    pairing.ask(5 * MS)
    return pairing


def receive(pairing, *frames):
    """Return the samples that `frames` complete."""
    samples = [pairing.on_frame(can_id, data) for can_id, data in frames]
    return [sample for sample in samples if sample is not None]


@pytest.mark.parametrize("order", [1, -1])
def test_force_and_torque_in_either_order_make_one_sample(pairing, order):
    (sample,) = receive(pairing, *[(FORCE_ID, FORCE), (TORQUE_ID, TORQUE)][::order])
    # Half a count of each.
    assert sample.wrench[:3] == pytest.approx((1.0, -2.5, -9.81), abs=0.002)
    assert sample.wrench[3:] == pytest.approx((0.1, -0.25, 0.015), abs=0.00013)
    assert (sample.status, sample.is_valid, sample.saturated) == (0, True, 0)
    assert sample.t_ns == 5 * MS + SAMPLING_DELAY_NS


@pytest.mark.parametrize(
    ("status", "is_valid", "saturated"),
    [(0x80, True, 0), (0x84, True, 0x3F), (0x01, True, 0x3F), (0xC4, False, 0x3F)],
)
def test_the_status_after_the_torque_applies_to_the_force_too(
    pairing, status, is_valid, saturated
):
    (sample,) = receive(
        pairing, (FORCE_ID, FORCE), (TORQUE_ID, TORQUE + bytes((status,)))
    )
    assert (sample.is_valid, sample.saturated) == (is_valid, saturated)
    assert sample.status == status


@pytest.mark.parametrize(
    ("wrench", "saturated"),
    [
        ((79.9, 0, 0, 0, 0, 0), 0),
        ((0, -80.0, 0, 0, 0, 0), 0b000010),
        ((0, 0, 127.9, 0, 0, 0), 0),
        ((0, 0, 135.0, 0, 0, 0), 0b000100),
        ((90.0, 0, -135.0, 0, 0, 0), 0b000101),
        ((0, 0, 0, 2.74, 0, 0), 0),
        ((0, 0, 0, 0, 0, -2.75), 0b100000),
    ],
)
def test_a_reading_at_its_range_is_saturated_in_that_axis(pairing, wrench, saturated):
    force, torque = encode_force(wrench[:3]), encode_torque(wrench[3:])
    (sample,) = receive(pairing, (FORCE_ID, force), (TORQUE_ID, torque))
    assert sample.saturated == saturated
    assert sample.is_valid


@pytest.mark.parametrize("half", [(FORCE_ID, FORCE), (TORQUE_ID, TORQUE)])
def test_half_a_reply_is_counted_and_never_paired_with_a_later_one(half):
    counters = BarrettCounters()
    pairing = WrenchPairing(counters)
    pairing.ask(0)
    receive(pairing, half)
    pairing.ask(CYCLE_NS)
    assert (counters.unpaired, counters.unanswered) == (1, 1)
    other = (FORCE_ID, FORCE) if half[0] == TORQUE_ID else (TORQUE_ID, TORQUE)
    assert receive(pairing, other) == []


@pytest.mark.parametrize("half", [(FORCE_ID, FORCE), (TORQUE_ID, TORQUE)])
def test_the_first_of_two_equal_halves_is_dropped(half):
    counters = BarrettCounters()
    pairing = WrenchPairing(counters)
    pairing.ask(0)
    assert receive(pairing, half, half) == []
    assert counters.unpaired == 1


def test_an_unsolicited_reply_is_dropped():
    counters = BarrettCounters()
    pairing = WrenchPairing(counters)
    pairing.ask(0)
    answer = [(FORCE_ID, FORCE), (TORQUE_ID, TORQUE)]
    assert len(receive(pairing, *answer, *answer)) == 1
    assert (counters.samples, counters.unasked) == (1, 1)


def test_frames_that_contradict_the_protocol_are_counted():
    counters = BarrettCounters()
    pairing = WrenchPairing(counters)
    pairing.ask(0)
    assert receive(pairing, (FORCE_ID, FORCE[:5]), (TORQUE_ID, b"")) == []
    assert counters.malformed == 2


frames = st.tuples(
    st.sampled_from([FORCE_ID, TORQUE_ID, 0x506, 0x423]), st.binary(max_size=8)
)


@given(st.lists(st.one_of(frames, st.none()), max_size=30))
def test_there_are_no_more_samples_than_requests(heard):
    counters = BarrettCounters()
    pairing = WrenchPairing(counters)
    samples = []
    for t_ns, frame in enumerate(heard):
        if frame is None:
            pairing.ask(t_ns)
        else:
            samples += receive(pairing, frame)
    assert len(samples) == counters.samples <= heard.count(None)
    times = [sample.t_ns for sample in samples]
    assert times == sorted(set(times))


def test_a_status_is_described():
    assert status_texts(0) == ()
    assert status_texts(0x80) == ("tare suggested",)
    assert status_texts(0xC4) == (
        "data bad now",
        "gauge 3 saturated since the tare",
        "tare suggested",
    )
    assert status_texts(0x21) == (
        "gauge 1 saturated since the tare",
        "gauge 6 saturated since the tare",
    )


class Bench:
    """A sensor and an arm on one simulated bus."""

    def __init__(self, load=lambda _: (0.0,) * 6, **options):
        options = NetworkOptions(**({"has_sensor": True} | options))
        self.rig = Rig(options, load=Load(load))
        self.network, self.clock = self.rig.network, self.rig.clock
        self.sensor = BarrettSensor(self.rig.link, self.clock)
        self.arm = WamArm(self.rig.link, self.clock)

    def started(self):
        self.arm.start()
        self.sensor.open()
        self.arm.attach_device(self.sensor)
        self.rig.sent.clear()
        return self

    def run(self, cycles):
        """Read, send and poll for some cycles; return (start, samples) of each."""
        found = []
        for _ in range(cycles):
            reading = self.arm.read(self.clock.t_ns)
            assert reading.is_complete
            found.append((reading.host_ns, self.sensor.poll(reading.host_ns)))
            self.arm.send(ZERO, ZERO)
            self.clock.sleep_until(reading.host_ns + CYCLE_NS)
        return found


def test_the_wrench_is_requested_right_after_the_positions():
    bench = Bench().started()
    begin_ns = bench.clock.t_ns
    bench.run(1)
    assert bench.rig.sent[:2] == [
        (begin_ns, 0x404, b"\x30"),
        (begin_ns, 0x008, b"\x36"),
    ]


def test_each_polling_cycle_has_the_sample_of_the_previous_one():
    bench = Bench().started()
    found = bench.run(46)
    assert found[0][1] == []
    for (asked_ns, _), (_, (sample,)) in pairwise(found):
        assert sample.t_ns == asked_ns + SAMPLING_DELAY_NS
    assert bench.sensor.counters == BarrettCounters(samples=45 + 20)


def test_a_sample_is_stamped_with_its_sampling_time():
    # The load encodes the time: 7.3 N/s, its steps not aligned with the cycles.
    begin_ns = SteppedClock().t_ns
    bench = Bench(lambda t_ns: ((t_ns - begin_ns) * 7.3e-9, 0, 0, 0, 0, 0)).started()
    samples = [sample for _, samples in bench.run(500) for sample in samples]
    assert len(samples) == 499  # the first cycle has none, a skipped one two
    shown = np.array([sample.wrench[0] for sample in samples])
    true = np.array([(sample.t_ns - begin_ns) * 7.3e-9 for sample in samples])
    # Steps of 0.05 N and counts of 4 mN, which average to nothing; 1 mN is 0.14 ms.
    assert np.abs(shown - true).max() < 0.028
    assert np.mean(shown - true) == pytest.approx(0.0, abs=0.001)


def test_the_sensor_does_not_delay_positions():
    def arrival(bench):
        bench.arm.start()
        if bench.network.options.has_sensor:
            bench.sensor.open()
            bench.arm.attach_device(bench.sensor)
        reading = bench.arm.read(bench.clock.t_ns)
        return reading.arm_ns - reading.host_ns

    assert arrival(Bench()) == arrival(Bench(has_sensor=False))


def test_a_silent_sensor_does_not_delay_the_arm():
    bench = Bench().started()
    bench.network.silence(8)
    found = bench.run(20)
    assert not any(samples for _, samples in found)
    assert bench.sensor.counters.unanswered == 19


def test_the_arms_start_up_wakes_the_sensor_with_the_pucks():
    bench = Bench(are_asleep=True)
    bench.arm.start()
    bench.rig.sent.clear()
    bench.sensor.open()
    assert (8, b"\x85\0\2\0\0\0") not in [(i, data) for _, i, data in bench.rig.sent]


def test_a_sensor_opened_first_is_woken_and_left_alone_while_it_boots():
    bench = Bench(are_asleep=True)
    bench.sensor.open()
    times = [t for t, _, _ in bench.rig.sent]
    wake = bench.rig.sent.index((times[1], 8, b"\x85\0\2\0\0\0"))
    assert times[wake + 1] - times[wake] >= 1000 * MS


def test_an_opened_sensor_reports_its_identity():
    fields = Bench().started().sensor.describe()
    assert fields["model"] == "Barrett force/torque sensor, node 8"
    assert fields["serial_number"] == "1008"
    assert fields["role"] == "ROLE 0x0006"
    assert fields["measured_rate"] == "20 of 20 questions answered"


def test_opening_sends_no_tare():
    bench = Bench()
    bench.sensor.open()
    assert not [data for _, _, data in bench.rig.sent if data[0] == 0xB6]


def test_a_missing_sensor_is_reported():
    with pytest.raises(LinkTimeoutError, match="node 8\\) does not answer") as caught:
        Bench(has_sensor=False).sensor.open()
    assert "ft_sensor.kind" in caught.value.hint


def test_a_sensor_that_does_not_wake_up_is_reported():
    with pytest.raises(DeviceFaultError, match="STAT unknown, not 2"):
        Bench(are_asleep=True, boot_ns=5000 * MS).sensor.open()


def test_a_node_without_force_and_torque_is_reported():
    bench = Bench()
    bench.network.faults.drop(TORQUE_ID, count=None)
    with pytest.raises(LinkTimeoutError, match=r"no force and torque \(ROLE 0x0006\)"):
        bench.sensor.open()


def test_a_sensor_with_a_saturated_gauge_is_refused():
    with pytest.raises(DeviceFaultError, match="data bad now, gauge 2 saturated"):
        Bench(lambda _: (0, 90.0, 0, 0, 0, 0)).sensor.open()


def test_closing_twice_discards_pending_samples():
    bench = Bench().started()
    bench.arm.read(bench.clock.t_ns)
    bench.rig.rest(CYCLE_NS)
    bench.arm.read(bench.clock.t_ns)
    bench.sensor.close()
    bench.sensor.close()
    assert bench.sensor.poll(0) == []
