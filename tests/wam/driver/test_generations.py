"""Every generation of firmware fulfils one contract on the fake bus."""

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import DeviceFaultError
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from tests.sweeps import swept
from wam.bus.frames import MOTOR_NODES
from wam.bus.property_client import PropertyClient
from wam.driver.arm import WamArm

HOME = np.array([0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0])
HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
CYCLE_NS = 2_000_000
# Motors and safety module have tables of their own: old and new ones, in any mixture.
GENERATIONS = [
    *((65, 200), (124, 61), (125, 200), (131, 61)),
    *((132, 200), (200, 61), (200, 200)),
]
TAU = np.array([1.0, -15.0, 2.0, 5.0, 0.3, -0.2, 0.05])


class Bench:
    """An arm of one generation on the fake bus."""

    def __init__(self, motor, safety, **options):
        options = NetworkOptions(
            vers=(motor,) * 7, safety_vers=safety, monitor_vers=3, **options
        )
        self.rig = Rig(options, HOME_COUNTS)
        self.arm = WamArm(self.rig.link, self.rig.clock)

    def cycle(self, tau):
        reading = self.arm.read(self.rig.clock.t_ns)
        sent = self.arm.send(tau, np.zeros(7))
        self.rig.clock.sleep_until(reading.host_ns + CYCLE_NS)
        return reading, sent


@pytest.fixture(params=GENERATIONS, ids=lambda p: f"{p[0]}-{p[1]}")
def generation(request):
    return request.param


@pytest.fixture
def bench(generation):
    bench = Bench(*generation)
    bench.arm.start()
    bench.rig.sent.clear()
    return bench


def test_start_up_reports_firmware_and_constants(generation):
    info = Bench(*generation).arm.start()
    assert ({p.vers for p in info.pucks}, info.safety_vers) == (
        {generation[0]},
        generation[1],
    )
    assert [p.cts for p in info.pucks] == [4096] * 7
    assert [p.ipnm for p in info.pucks] == [2700] * 4 + [6500] * 2 + [17474]
    assert (info.is_zeroed, info.safety_mode) == (True, SafetyMode.IDLE)


def test_start_up_wakes_sleeping_pucks_and_then_reads_their_own_firmware(generation):
    info = Bench(*generation, are_asleep=True).arm.start()
    assert {(p.vers, p.was_asleep) for p in info.pucks} == {(generation[0], True)}


def test_positions_are_read(bench):
    reading, _ = bench.cycle(np.zeros(7))
    assert reading.is_complete
    assert tuple(reading.counts) == HOME_COUNTS


def test_torques_reach_the_motors(bench):
    bench.rig.network.pendant("activate")
    bench.cycle(TAU)
    assert bench.rig.motors.units == [-64, -877, 556, -750, 168, 34, -59]


def test_the_safety_module_is_watched(bench):
    bench.rig.network.pendant("activate")
    for _ in range(30):
        bench.cycle(np.zeros(7))
    assert bench.arm.safety_mode() is SafetyMode.ACTIVE
    bench.rig.network.set_bus_voltage(33.0)
    for _ in range(30):
        bench.cycle(np.zeros(7))
    assert bench.arm.safety_warnings() == ("voltage",)


def test_positions_are_defined(generation):
    bench = Bench(*generation, is_zeroed=False)
    bench.arm.start()
    bench.arm.define_position(HOME)
    reading, _ = bench.cycle(np.zeros(7))
    assert reading.q == pytest.approx(HOME, abs=1.2e-4)  # one count of floor
    assert bench.arm.safety.is_zeroed()


@pytest.mark.parametrize(
    ("vers", "ecmax"), [(65, 96), (124, 96), (125, 100), (131, 100), (132, 101)]
)
def test_a_property_is_read_at_the_number_of_its_firmware(vers, ecmax):
    rig = Rig(NetworkOptions(vers=(vers,) * 7))
    properties = PropertyClient(rig.link, rig.clock)
    answering = [n for n in (96, 100, 101) if properties.get(1, n) is not None]
    # Up to 124 ECMIN is 97; from 125 on ECMIN is one above ECMAX.
    assert ecmax in answering
    assert (96 in answering) is (vers < 125)
    assert properties.get(1, ecmax) == 0


def test_pucks_of_several_generations_work_together():
    rig = Rig(NetworkOptions(vers=(65, 124, 125, 131, 132, 175, 200)), HOME_COUNTS)
    info = WamArm(rig.link, rig.clock).start()
    assert [p.cts for p in info.pucks] == [4096] * 7


# Where a table changes, the versions on both sides; 32 has no IPNM, before 44 there is
# no POLES.
BREAKS = (44, 45, 47, 50, 51, 61, 63, 64, 65, 68, 114, 119, 125, 132, 142, 145, 168)
DOCUMENTED = sorted({40, 175, 174, 200, *BREAKS, *(vers - 1 for vers in BREAKS)})
# Beginnings and ends of the ranges in which P, T, CTS, IPNM, POLES, PEN keep a number.
RANGE_ENDS = (40, 44, 49, 50, 60, 61, 63, 64, 65, 200)
# P and T are numbered alike in 32..49, 50..60 and from 61 on, in hexadecimal:
REQUESTS = {40: ("1a", "8a"), 50: ("1a", "89"), 60: ("1a", "89"), 61: ("30", "aa")}


@pytest.mark.parametrize("vers", DOCUMENTED)
def test_every_documented_firmware_starts_and_is_read(vers):
    bench = Bench(vers, vers, are_asleep=True)
    info = bench.arm.start()
    assert [p.ipnm for p in info.pucks] == [2700] * 4 + [6500] * 2 + [17474]
    assert [p.cts for p in info.pucks] == [4096] * 7
    assert info.pendant.faults == ()
    assert ("POLES" in " ".join(info.warnings)) is (vers < 44)
    reading, _ = bench.cycle(np.zeros(7))
    assert reading.is_complete


@pytest.mark.parametrize("vers", RANGE_ENDS)
def test_every_firmware_is_zeroed_driven_and_stopped(vers):
    bench = Bench(vers, vers, is_zeroed=False)
    bench.arm.start()
    bench.arm.define_position(HOME)
    assert bench.arm.start().is_zeroed
    bench.rig.network.pendant("activate")
    reading, _ = bench.cycle(TAU)
    assert reading.q == pytest.approx(HOME, abs=1.2e-4)  # one count of floor
    assert bench.rig.motors.units == [-64, -877, 556, -750, 168, 34, -59]
    assert bench.arm.idle()
    assert bench.rig.network.safety_mode is SafetyMode.IDLE


@pytest.mark.parametrize("vers", RANGE_ENDS)
def test_every_safety_firmware_accepts_limits_and_reports_its_cause(vers):
    bench = Bench(200, vers)
    assert bench.arm.start().warnings == ()
    bench.rig.network.pendant("activate")
    bench.cycle(np.zeros(7))
    bench.rig.network.trip("torque")
    for _ in range(4):
        bench.cycle(TAU)
    assert bench.arm.safety_mode() is SafetyMode.IDLE
    assert bench.arm.safety_faults() == ("torque",)


@pytest.mark.parametrize("vers", swept(RANGE_ENDS, {40, 61, 200}))
def test_every_firmware_is_polled_for_telemetry(vers):
    bench = Bench(vers, vers)
    bench.arm.start()
    bench.rig.network.set_bus_voltage(41.0)
    for node in MOTOR_NODES:
        bench.rig.network.set_property(node, "TEMP", 50 + node)
    for _ in range(28 * 50 + 1):
        bench.cycle(np.zeros(7))
    health = bench.arm.health()
    assert [p.puck_degc for p in health] == [50 + node for node in MOTOR_NODES]
    assert [(p.motor_degc, p.bus_voltage, p.error) for p in health] == [(33, 41, 0)] * 7


@pytest.mark.parametrize(("vers", "bytes_"), REQUESTS.items())
def test_requests_and_torques_have_the_bytes_of_their_firmware(vers, bytes_):
    bench = Bench(vers, 200)
    bench.arm.start()
    bench.rig.sent.clear()
    bench.cycle(TAU)
    first = {can_id: data[:1].hex() for _, can_id, data in bench.rig.sent}
    assert (first[0x404], first[0x401], first[0x402]) == (*bytes_, bytes_[1])


@pytest.mark.parametrize(
    ("motor", "safety", "who", "taken_as"),
    [
        (201, 200, "puck 1,2,3,4,5,6,7", 200),
        (32767, 200, "puck 1,2,3,4,5,6,7", 200),
        (200, 201, "the safety module", 200),
        (200, 31, "the safety module", 32),
        (200, 0, "the safety module", 32),
    ],
)
def test_undocumented_firmware_is_driven_as_the_nearest_with_a_warning(
    motor, safety, who, taken_as
):
    # Unknown firmware is driven as the newest or the oldest known one.
    bench = Bench(motor, safety)
    (warning,) = bench.arm.start().warnings
    assert f"of {who} is not documented" in warning
    assert f"as in {taken_as}." in warning
    bench.rig.network.pendant("activate")
    bench.cycle(TAU)
    assert bench.rig.motors.units == [-64, -877, 556, -750, 168, 34, -59]


@pytest.mark.parametrize("vers", [0, 31, 32])
def test_firmware_without_torque_units_is_refused(vers):
    bench = Bench(vers, 200)
    with pytest.raises(DeviceFaultError) as caught:
        bench.arm.start()
    assert f"Puck 1 with firmware {vers} has no IPNM" in caught.value.message
    assert "newer firmware" in caught.value.hint


@pytest.mark.parametrize("other", [40, 50, 60])
def test_pucks_that_cannot_share_a_torque_frame_are_refused(other):
    rig = Rig(NetworkOptions(vers=(200, 200, other, 200, 200, 200, 200)), HOME_COUNTS)
    with pytest.raises(DeviceFaultError) as caught:
        WamArm(rig.link, rig.clock).start()
    assert f"200 200 {other} 200 200 200 200" in caught.value.message
    assert "P or T" in caught.value.message
