"""A puck with unexpected properties is refused before the first torque."""

import pytest

from acquisition.errors import SettingsError, UnfitDeviceError
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.frames import decode_request
from wam.driver.arm import WamArm
from wam.driver.puck_properties import compare, known_table, shipped_table
from wam.driver.settings import ArmSettings
from wam.model.constants import load_constants

HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)


def start(changes=(), text="", **options):
    rig = Rig(NetworkOptions(**options), HOME_COUNTS)
    for node, name, value in changes:
        rig.network.set_property(node, name, value)
    pucks = known_table(text, "pucks.toml")
    return WamArm(rig.link, rig.clock, ArmSettings(pucks=pucks)).start()


def refusal(*changes, **options):
    with pytest.raises(UnfitDeviceError) as caught:
        start(changes, **options)
    return caught.value


@pytest.mark.parametrize(
    ("node", "name", "value", "expected"),
    [
        (3, "PIDX", 2, "3"),
        (6, "PIDX", 1, "2"),
        (3, "GRPB", 2, "1"),
        (5, "GRPA", 1, "0"),
        (1, "GRPC", 5, "4"),
        (2, "MT", 700, "4860"),
        (4, "MT", 0, "4320"),
        (7, "MT", 1000, "1370 to 1600"),
        (2, "IPNM", 270, "2430 to 2970"),
        (2, "IPNM", 6500, "2430 to 2970"),
        (3, "IPNM", 2500, "within 2 % of the 2700 of puck 2"),
        (7, "IPNM", 2700, "15700 to 19200"),
        (2, "CTS", 8192, "4096"),
        (6, "CTS", 40960, "4096"),
        (4, "POLES", 8, "12"),
        (5, "ID", 4, "5"),
    ],
)
def test_a_puck_of_another_position_or_arm_is_refused(node, name, value, expected):
    error = refusal((node, name, value))
    assert error.message == f"{name} of puck {node} is {value}, expected {expected}."
    assert "properties of rig.toml" in error.hint
    assert error.exit_code == 3


def test_nothing_is_sent_to_the_motors_of_a_refused_arm():
    rig = Rig(counts=HOME_COUNTS)
    rig.network.set_property(3, "PIDX", 2)
    with pytest.raises(UnfitDeviceError):
        WamArm(rig.link, rig.clock).start()
    assert not any(can_id in (0x401, 0x402) for _, can_id, _ in rig.sent)


def test_all_wrong_values_are_reported_together_with_the_remedy():
    error = refusal((3, "PIDX", 2), (2, "MT", 700), (2, "IPNM", 27000))
    assert error.message == (
        "PIDX of puck 3 is 2, expected 3; IPNM of puck 2 is 27000, expected 2430 to "
        "2970; MT of puck 2 is 700, expected 4860."
    )
    assert "003#C60003000000 003#9E0046000000, 002#AB00FC120000" in error.hint


def test_the_frames_in_the_remedy_set_the_expected_value():
    error = refusal((3, "PIDX", 2))
    can_id, data = next(w for w in error.hint.split() if "#C6" in w).split("#")
    rig = Rig(counts=HOME_COUNTS)
    rig.network.set_property(3, "PIDX", 2)
    rig.link.send(int(can_id, 16), bytes.fromhex(data))
    assert decode_request(bytes.fromhex(data)) == (70, 3)
    rig.rest(10_000_000)
    WamArm(rig.link, rig.clock).start()


@pytest.mark.parametrize(
    ("node", "name", "value"),
    [(7, "MT", 4860), (3, "OTEMP", 120), (4, "VBUS", 41)],
)
def test_properties_the_host_bounds_or_watches_only_warn(node, name, value):
    (warning,) = start([(node, name, value)]).warnings
    assert warning.startswith(f"{name} of puck {node} is {value}, expected ")


@pytest.mark.parametrize("mt", [1370, 1600])
def test_both_known_wrists_are_accepted(mt):
    assert start([(7, "MT", mt)]).warnings == ()


def test_optical_encoders_in_all_seven_pucks_are_accepted():
    assert start(cts=(40960,) * 7).warnings == ()


def test_firmware_that_differs_is_a_warning():
    (warning,) = start(vers=(200, 200, 200, 200, 190, 200, 200)).warnings
    assert warning == "The firmware of the pucks differs: 200 200 200 200 190 200 200."


def test_serial_numbers_are_read_and_recorded():
    info = start()
    assert [puck.serial for puck in info.pucks] == list(range(1001, 1008))
    assert info.metadata()["arm:serials"] == "1001 1002 1003 1004 1005 1006 1007"


def test_pucks_with_one_serial_number_are_a_warning():
    (warning,) = start([(2, "SN", 1001)]).warnings
    assert "1001 1001 1003" in warning


def test_an_unanswered_property_is_a_warning():
    rig = Rig(counts=HOME_COUNTS)
    receive = rig.network.receive
    rig.network.receive = lambda t, i, d: (
        None if (i, bytes(d)) == (3, b"\x46") else receive(t, i, d)
    )
    (warning,) = WamArm(rig.link, rig.clock).start().warnings
    assert warning == "Puck 3 does not answer GET PIDX: it is not compared."


def test_values_of_this_arm_take_precedence_over_factory_values():
    text = "[POLES]\nvalues = [12, 12, 12, 10, 8, 8, 6]\n"
    assert start([(4, "POLES", 10)], text).warnings == ()
    with pytest.raises(UnfitDeviceError, match="POLES of puck 4 is 12, expected 10"):
        start([], text)


def test_another_arm_is_recognised_by_its_serial_numbers():
    text = "[SN]\nvalues = [1001, 1002, 1003, 1004, 1005, 1006, 2007]\n"
    with pytest.raises(UnfitDeviceError, match="SN of puck 7 is 1007, expected 2007"):
        start([], text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[MTT]\nvalues = [1, 1, 1, 1, 1, 1, 1]", "MTT"),
        ("[MT]\nvalues = [1, 1, 1]", "MT.values"),
        ("[MT]\nvalues = [1, 1, 1, 1, 1, 1, 1]\nlow = [2, 0, 0, 0, 0, 0, 0]", "order"),
        ("[IPNM]\nvalues = [1, 1, 1, 1, 1, 1, 1]\nalike = [[0, 9]]", "1 to 7"),
        ("MT = ", "value"),
    ],
)
def test_a_file_that_is_not_a_table_is_refused_by_name(text, words):
    with pytest.raises(SettingsError, match=r"ours\.toml is no table") as caught:
        known_table(text, "ours.toml")
    assert words in caught.value.message


def test_the_shipped_table_holds_the_constants_of_the_model():
    constants = load_constants()
    found = {
        "CTS": constants.cts,
        "IPNM": constants.ipnm,
        "POLES": constants.poles,
        "MT": constants.mt,
    }
    assert compare(shipped_table(), found) == []


def test_the_number_of_remedies_listed_is_limited():
    three = ((3, "PIDX", 2), (6, "PIDX", 1), (3, "GRPB", 2))
    assert "and so on" not in refusal(*three).hint
    error = refusal(*three, (5, "GRPA", 1))
    assert error.message.count("expected") == 4
    assert ", and so on." in error.hint
    assert error.hint.count("#9E") == 3  # each of them is kept by a frame


def test_motors_of_one_differential_may_differ_within_the_tolerance():
    assert start([(3, "IPNM", 2646)]).warnings == ()
    assert "IPNM of puck 3 is 2645" in refusal((3, "IPNM", 2645)).message
