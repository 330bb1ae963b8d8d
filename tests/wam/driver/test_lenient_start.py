"""Values that the vendor's library does not check give a warning, not a refusal."""

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import DeviceFaultError, LinkTimeoutError
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.frames import decode_reply, encode_reply, position_reply_id
from wam.driver.arm import WamArm
from wam.driver.pendant import MONITORS, SafetyLevel, decode_pendant

PEN, SAFETY_REPLY = 0xAB, 0x546
ZERO = np.zeros(7)
CALM = 0x0D3F1249
CYCLE_NS = 2_000_000


class Bench:
    """An arm whose safety module reports its word modified by `change`."""

    def __init__(self, change=lambda word: word):
        self.change = change
        # A heartbeat longer than any test.
        self.rig = Rig(NetworkOptions(heartbeat_ns=10_000_000_000))
        receive = self.rig.link.receive
        self.rig.link.receive = lambda: [self.altered(frame) for frame in receive()]
        self.arm = WamArm(self.rig.link, self.rig.clock)

    def altered(self, frame):
        if frame.can_id != SAFETY_REPLY or frame.data[0] != PEN:
            return frame
        word = self.change(decode_reply(frame.data).value)
        return frame._replace(data=encode_reply(PEN & 0x7F, word, is_wide=True))

    def run(self, cycles):
        for _ in range(cycles):
            reading = self.arm.read(self.rig.clock.t_ns)
            self.arm.send(ZERO, ZERO)
            self.rig.clock.sleep_until(reading.host_ns + CYCLE_NS)


def deaf_to(rig, node, request):
    """Let a node ignore one request."""
    receive = rig.network.receive
    rig.network.receive = lambda t, i, d: (
        None if (i, bytes(d)) == (node, request) else receive(t, i, d)
    )


def field_set(index, bits):
    return lambda word: word & ~(7 << 3 * index) | bits << 3 * index


@pytest.mark.parametrize(
    ("index", "bits"),
    [*((i, 0b000) for i in range(5)), (0, 0b011), (1, 0b101), (3, 0b110), (4, 0b111)],
)
def test_an_ambiguous_monitor_is_reported_and_the_arm_starts(index, bits):
    info = Bench(field_set(index, bits)).arm.start()
    assert info.pendant.inconsistent_monitors == (MONITORS[index],)
    (warning,) = info.warnings
    assert MONITORS[index] in warning
    assert f"{field_set(index, bits)(CALM):08X}" in warning


def test_an_empty_word_names_every_monitor_and_no_fault():
    info = Bench(lambda _: 0).arm.start()
    assert info.pendant.inconsistent_monitors == MONITORS
    assert (info.pendant.faults, info.pendant.warnings) == ((), ())


def test_a_documented_word_gives_no_warning():
    assert Bench().arm.start().warnings == ()


def test_a_module_without_property_pen_is_driven_with_a_warning():
    bench = Bench()
    deaf_to(bench.rig, 0x00A, b"\x2b")
    info = bench.arm.start()
    (warning,) = info.warnings
    assert "GET PEN" in warning
    assert info.pendant.inconsistent_monitors == MONITORS
    assert info.safety_mode is SafetyMode.IDLE


def test_the_other_monitors_are_still_watched():
    bench = Bench(field_set(MONITORS.index("other"), 0))
    bench.arm.start()
    bench.rig.network.set_bus_voltage(33.0)
    bench.run(40)
    assert bench.arm.safety_warnings() == ("voltage",)
    assert bench.arm.counters.malformed == 0


def test_a_monitor_valid_at_the_start_must_stay_valid():
    bench = Bench(field_set(MONITORS.index("other"), 0))
    bench.arm.start()
    unclear = field_set(MONITORS.index("velocity"), 0)
    bench.change = lambda word: unclear(field_set(4, 0)(word))
    bench.rig.network.set_bus_voltage(33.0)
    bench.run(40)
    assert bench.arm.safety_warnings() == ()
    assert bench.arm.counters.malformed > 0


def test_exemptions_do_not_carry_over_to_the_next_start():
    bench = Bench(lambda _: 0)
    bench.arm.start()
    bench.change = lambda word: word
    assert bench.arm.start().warnings == ()
    bench.change = lambda _: 0
    bench.run(40)
    assert bench.arm.counters.malformed > 0


def test_idle_is_confirmed_whatever_the_monitor_word():
    bench = Bench(lambda _: 0)
    bench.arm.start()
    bench.rig.network.pendant("activate")
    bench.run(3)
    assert bench.arm.idle()
    assert bench.rig.network.safety_mode is SafetyMode.IDLE


def test_only_exempt_monitors_may_be_ambiguous():
    word = field_set(0, 0)(CALM)
    assert decode_pendant(word, ("velocity",)).velocity is SafetyLevel.UNKNOWN
    with pytest.raises(DeviceFaultError, match="velocity"):
        decode_pendant(word, ("torque",))


def test_a_puck_without_its_absolute_angle_is_driven_with_a_warning():
    bench = Bench()
    deaf_to(bench.rig, 3, b"\x42")
    info = bench.arm.start()
    assert [p.node for p in info.pucks if p.mech is None] == [3]
    (warning,) = info.warnings
    assert "Puck 3" in warning
    assert "MECH" in warning


@pytest.mark.parametrize("number", [0x44, 0x56])  # CTS, IPNM
def test_a_value_the_vendor_library_needs_is_still_required(number):
    bench = Bench()
    deaf_to(bench.rig, 3, bytes((number,)))
    with pytest.raises(LinkTimeoutError, match="Node 3"):
        bench.arm.start()


def test_firmware_and_warnings_are_recorded():
    fields = Bench(lambda _: 0).arm.start().metadata()
    assert fields["arm:firmware"] == "200 200 200 200 200 200 200"
    assert fields["arm:safety_firmware"] == "200"
    assert "velocity, torque, voltage, heartbeat, other" in fields["arm:warnings"]
    assert Bench().arm.start().metadata()["arm:warnings"] == "none"


@pytest.mark.parametrize("lost", [3, 30, 150])
def test_first_positions_may_take_as_long_as_in_the_vendor_library(lost):
    bench = Bench()
    bench.rig.network.faults.drop(position_reply_id(5), count=lost)
    bench.arm.start()
    assert bench.arm.read(bench.rig.clock.t_ns).is_complete


def test_positions_that_never_arrive_are_an_error_after_the_timeout():
    bench = Bench()
    bench.rig.network.faults.drop(position_reply_id(5), count=None)
    before_ns = bench.rig.clock.t_ns
    with pytest.raises(LinkTimeoutError, match="Puck 5 does not report a position"):
        bench.arm.start()
    assert bench.rig.clock.t_ns - before_ns > 1_000_000_000


def test_a_bus_that_breaks_before_the_first_positions_ends_the_wait():
    bench = Bench()
    receive = bench.rig.network.receive

    def break_at_first_question(t_ns, can_id, data):
        if can_id == 0x404 and bytes(data) == b"\x30":
            bench.rig.network.faults.go_down()
        receive(t_ns, can_id, data)

    bench.rig.network.receive = break_at_first_question
    with pytest.raises(LinkTimeoutError, match="Pucks 1,2,3,4,5,6,7"):
        bench.arm.start()
