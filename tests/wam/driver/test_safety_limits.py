from itertools import pairwise

import pytest

from tests.fakes.stepped import Rig
from wam.bus.frames import encode_set
from wam.driver.arm import WamArm
from wam.driver.safety_module import SafetyLimits
from wam.driver.settings import ArmSettings

IFAULT = 0xB7
RAISED = SafetyLimits(
    speed_warning=1.35,
    speed_fault=1.5,
    torque_warning_units=7290,
    torque_fault_units=8100,
)


def start(rig, limits):
    return WamArm(rig.link, rig.clock, ArmSettings(safety_limits=limits)).start()


def limit_writes(rig):
    """Return (time, data) of every limit that was sent to the safety module."""
    writes = [(t, d) for t, i, d in rig.sent if i == 0x00A and len(d) == 6]
    return [(t, d) for t, d in writes if d[0] != IFAULT]


def test_the_defaults_are_the_power_up_values():
    assert SafetyLimits().words() == {
        **{"VL1": 2048, "VL2": 4096},
        **{"TL1": 4731, "TL2": 5204},
    }


def test_limits_are_written_with_the_golden_bytes():
    rig = Rig()
    start(rig, RAISED)
    assert [data.hex(" ") for _, data in limit_writes(rig)][8:] == [
        "ad 00 99 15 00 00",
        "ae 00 00 18 00 00",
        "af 00 7a 1c 00 00",
        "b0 00 a4 1f 00 00",
    ]


def test_each_limit_is_reset_to_its_power_up_value_first():
    rig = Rig()
    start(rig, RAISED)
    resets = [data.hex(" ") for _, data in limit_writes(rig)][:8]
    assert resets == [
        f"{what} 00 {number} 00 00 00"
        for number in ("2d", "2e", "2f", "30")
        for what in ("a0", "9f")
    ]


def test_configuration_frames_are_spaced():
    rig = Rig()
    start(rig, RAISED)
    times = [t for t, _ in limit_writes(rig)]
    assert len(times) == 12
    assert min(b - a for a, b in pairwise(times)) >= 10_000_000


def test_limits_left_by_another_program_are_reset():
    rig = Rig()
    rig.link.send(0x00A, encode_set(46, 8192))
    rig.rest(1_000_000)
    start(rig, SafetyLimits())
    rig.rest(1_000_000)
    rig.link.receive()
    rig.link.send(0x00A, b"\x2e")
    rig.rest(1_000_000)
    assert [f.data.hex(" ") for f in rig.link.receive()] == ["ae 00 00 10"]


def test_a_limit_the_module_refuses_is_reported_with_both_values():
    rig = Rig()
    receive = rig.network.receive
    set_vl2 = encode_set(46, 6144)
    rig.network.receive = lambda t, i, d: (
        None if (i, bytes(d)) == (0x00A, set_vl2) else receive(t, i, d)
    )
    (warning,) = start(rig, RAISED).warnings
    assert "VL2 = 4096, expected 6144" in warning


@pytest.mark.parametrize(("name", "number"), [("VL1", 45), ("TL2", 48)])
def test_an_unreadable_limit_gives_a_warning(name, number):
    rig = Rig()
    receive = rig.network.receive
    rig.network.receive = lambda t, i, d: (
        None if (i, bytes(d)) == (0x00A, bytes((number,))) else receive(t, i, d)
    )
    (warning,) = start(rig, RAISED).warnings
    assert f"GET {name}" in warning
