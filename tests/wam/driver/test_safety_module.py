import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import DeviceFaultError, LinkTimeoutError
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.property_client import PropertyClient
from wam.driver.pendant import (
    PendantButton,
    SafetyLevel,
    decode_pendant,
    encode_pendant,
)
from wam.driver.safety_module import SafetyModule, decode_mode

WORDS = [0x0D3F1249, 0x0E3F1249, 0x00794249, 0x0D3F124C, 0x0D3F1849]


def client(rig):
    return SafetyModule(PropertyClient(rig.link, rig.clock), rig.clock, vers=200)


def test_idle_without_fault_is_read_from_the_word():
    pendant = decode_pendant(0x0D3F1249)
    assert pendant.is_idle_lit
    assert not pendant.is_active_lit
    assert (pendant.button, pendant.faults) == (PendantButton.NONE, ())
    assert pendant.segments == 0x3F


def test_active_lamp_is_read_from_the_word():
    assert decode_pendant(0x0E3F1249).is_active_lit


@pytest.mark.parametrize(
    ("word", "fault"),
    [(0x00794249, "other"), (0x0D3F124C, "velocity"), (0x0D3F1849, "heartbeat")],
)
def test_each_monitor_has_its_field(word, fault):
    assert decode_pendant(word).faults == (fault,)


@pytest.mark.parametrize(
    ("button", "bits"), [("E_STOP", 0), ("ACTIVATE", 1), ("IDLE", 2), ("NONE", 3)]
)
def test_the_pressed_button_is_read_from_the_word(button, bits):
    word = 0x0D3F1249 & ~(3 << 26) | bits << 26
    assert decode_pendant(word).button.name == button


def test_a_warning_is_not_a_fault():
    pendant = decode_pendant(0x0D3F1251)
    assert pendant.torque is SafetyLevel.WARNING
    assert pendant.faults == ()


@pytest.mark.parametrize("word", [0x0D3F1248, 0x0D3F124B, 0])
def test_a_field_that_is_not_one_hot_is_an_error(word):
    with pytest.raises(DeviceFaultError, match="velocity field"):
        decode_pendant(word)


@pytest.mark.parametrize("word", WORDS)
def test_a_word_round_trips(word):
    assert encode_pendant(decode_pendant(word)) == word


def test_an_undefined_mode_is_unknown():
    assert [decode_mode(v) for v in (0, 2, 3, -1)] == [
        *(SafetyMode.E_STOP, SafetyMode.ACTIVE),
        *(SafetyMode.UNKNOWN, SafetyMode.UNKNOWN),
    ]


def test_the_module_answers_mode_and_pendant():
    rig = Rig()
    assert client(rig).mode() is SafetyMode.IDLE
    assert client(rig).pendant() == decode_pendant(0x0D3F1249)


def test_an_active_arm_is_lowered_to_idle():
    rig = Rig()
    rig.network.pendant("activate")
    assert client(rig).lower_to_idle(50_000_000) is SafetyMode.IDLE
    assert rig.network.safety_mode is SafetyMode.IDLE


def test_the_host_cannot_leave_e_stop():
    rig = Rig(NetworkOptions(safety_mode=SafetyMode.E_STOP))
    assert client(rig).lower_to_idle(50_000_000) is SafetyMode.E_STOP
    assert rig.network.safety_mode is SafetyMode.E_STOP


def test_a_silent_module_is_unknown_after_the_deadline():
    rig = Rig()
    rig.network.silence(10)
    begin_ns = rig.clock.t_ns
    assert client(rig).lower_to_idle(50_000_000) is SafetyMode.UNKNOWN
    assert rig.clock.t_ns - begin_ns < 80_000_000  # one retry beyond


def test_a_silent_module_is_an_error_if_a_reply_is_required():
    rig = Rig()
    rig.network.silence(10)
    with pytest.raises(LinkTimeoutError, match="MODE"):
        client(rig).mode()


def test_zero_is_marked_and_confirmed():
    rig = Rig(NetworkOptions(is_zeroed=False))
    safety = client(rig)
    assert not safety.is_zeroed()
    safety.mark_zeroed()
    assert safety.is_zeroed()


class Answers:
    """A module that answers every request with one number."""

    def __init__(self, value):
        self.value, self.written = value, []

    def require(self, node, number, name):
        return self.value

    def set(self, node, number, value):
        self.written.append((node, number, value))

    def pause(self, duration_ns):
        """Wait for nothing."""


@pytest.mark.parametrize("value", [3, 5, -1])
def test_an_undefined_mode_is_an_error(value):
    with pytest.raises(DeviceFaultError, match=f"mode {value}"):
        SafetyModule(Answers(value), None, 200).mode()


def test_a_module_that_rejects_the_zero_is_an_error():
    answers = Answers(0)
    with pytest.raises(DeviceFaultError, match="ZERO"):
        SafetyModule(answers, None, 200).mark_zeroed()
    assert [value for *_, value in answers.written] == [1]
