"""One contract, run over the fake bus for every generation of firmware."""

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import DeviceFaultError
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.frames import decode_torques
from wam.bus.property_client import PropertyClient
from wam.driver.arm import WamArm

HOME = np.array([0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0])
HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
CYCLE_NS = 2_000_000
MOTORS = (65, 124, 125, 131, 132, 200)
SAFETY = (61, 200)
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


@pytest.fixture(
    params=[(m, s) for m in MOTORS for s in SAFETY], ids=lambda p: f"{p[0]}-{p[1]}"
)
def generation(request):
    return request.param


@pytest.fixture
def bench(generation):
    bench = Bench(*generation)
    bench.arm.start()
    bench.rig.sent.clear()
    return bench


def test_start_up_tells_the_firmware_and_the_constants(generation):
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


def test_idle_is_confirmed_before_zero_torque(bench):
    bench.rig.network.pendant("activate")
    bench.cycle(TAU)
    bench.rig.sent.clear()
    assert bench.arm.idle()
    order = [(i, d) for _, i, d in bench.rig.sent if i != 0x00A]
    assert [decode_torques(data) for _, data in order] == [(0, 0, 0, 0)] * 2
    assert bench.rig.network.safety_mode is SafetyMode.IDLE


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
def test_a_property_that_moved_is_where_its_firmware_has_it(vers, ecmax):
    rig = Rig(NetworkOptions(vers=(vers,) * 7))
    properties = PropertyClient(rig.link, rig.clock)
    answering = [n for n in (96, 100, 101) if properties.get(1, n) is not None]
    # Up to 124 ECMIN is 97; from 125 on ECMIN is one above ECMAX.
    assert ecmax in answering
    assert (96 in answering) is (vers < 125)
    assert properties.get(1, ecmax) == 0


def test_pucks_of_two_generations_work_together():
    rig = Rig(NetworkOptions(vers=(65, 124, 125, 131, 132, 175, 200)), HOME_COUNTS)
    info = WamArm(rig.link, rig.clock).start()
    assert [p.cts for p in info.pucks] == [4096] * 7


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            NetworkOptions(vers=(200,) * 4 + (64,) + (200,) * 2),
            "Puck 5 has firmware 64; 65 or later is needed.",
        ),
        (
            NetworkOptions(safety_vers=60),
            "The safety module has firmware 60; 61 or later is needed.",
        ),
    ],
)
def test_older_firmware_is_refused_with_what_is_needed(options, message):
    rig = Rig(options)
    with pytest.raises(DeviceFaultError) as caught:
        WamArm(rig.link, rig.clock).start()
    assert caught.value.message == message
    assert "newer firmware" in caught.value.hint
