from itertools import pairwise

import pytest

from acquisition.errors import SettingsError
from wam.bus.properties import (
    Device,
    PuckRole,
    device_of,
    is_wide,
    names,
    nearest_documented,
    numbers,
    property_number,
)

# Property numbers in the CAN frames of a current arm.
CURRENT = {
    **{"T": 42, "MT": 43, "P": 48, "MECH": 66, "CTS": 68, "PIDX": 70, "IPNM": 86},
    **{"POLES": 90, "EN": 94, "JP": 96, "ECMAX": 101, "ECMIN": 102, "IHIT": 108},
    **{"MODE": 8, "TEMP": 9, "THERM": 20, "GRPA": 26, "SAVE": 30, "DEF": 32},
}


@pytest.mark.parametrize(("name", "number"), CURRENT.items())
def test_current_motor_firmware_has_its_property_numbers(name, number):
    assert property_number(Device.MOTOR, name, 200) == number


@pytest.mark.parametrize(
    ("name", "vers", "number"),
    [
        ("P", 60, 26),
        ("P", 61, 48),
        ("T", 49, 10),
        ("T", 50, 9),
        ("T", 61, 42),
        ("CTS", 63, 65),
        ("CTS", 64, 66),
        ("CTS", 65, 68),
        ("EN", 124, 77),
        ("EN", 132, 94),
        ("ECMAX", 131, 100),
        ("ECMAX", 132, 101),
        ("V", 118, 106),
        ("V", 119, 44),
        ("HOLD", 131, 94),
        ("HOLD", 132, 77),
        ("IPNM", 36, 108),
        ("IPNM", 61, 83),
        ("IPNM", 65, 86),
        ("POLES", 44, 112),
        ("POLES", 61, 87),
        ("MECH", 60, 28),
        ("TEMP", 60, 39),
        ("THERM", 60, 46),
        ("VBUS", 60, 47),
    ],
)
def test_property_numbers_depend_on_the_firmware(name, vers, number):
    assert property_number(Device.MOTOR, name, vers) == number


@pytest.mark.parametrize(("name", "vers"), [("D", 50), ("ITOR", 175), ("P", 20)])
def test_a_property_the_firmware_lacks_is_an_error_with_its_name(name, vers):
    with pytest.raises(SettingsError, match=f"{vers} has no property {name}"):
        property_number(Device.MOTOR, name, vers)


def test_safety_module_has_its_own_property_numbers():
    table = numbers(Device.SAFETY, 200)
    assert [table[n] for n in ("ZERO", "PEN", "VL2", "TL2", "IFAULT", "VNOM")] == [
        *(42, 43, 46, 48, 55, 56)
    ]
    assert table["MODE"] == 8
    assert "P" not in table


def test_old_safety_firmware_shares_the_motor_table():
    table = numbers(Device.SAFETY, 40)
    assert (table["PEN"], table["P"]) == (85, 26)


@pytest.mark.parametrize(
    ("vers", "expected"),
    [
        (32, (55, 85, 91, 93, 100, 88, 89)),
        (33, (56, 87, 93, 95, 102, 90, 91)),
        (36, (55, 85, 91, 93, 100, 88, 89)),
        (60, (55, 85, 91, 93, 100, 88, 89)),
        (61, (42, 43, 46, 48, 55, 31, 32)),
    ],
)
def test_property_numbers_of_the_safety_module_depend_on_the_firmware(vers, expected):
    requested = ("ZERO", "PEN", "VL2", "TL2", "IFAULT", "LOAD", "DEF")
    assert tuple(property_number(Device.SAFETY, n, vers) for n in requested) == expected


@pytest.mark.parametrize(
    ("vers", "nearest"), [(-5, 32), (31, 32), (32, 32), (200, 200), (201, 200)]
)
def test_an_unknown_firmware_maps_to_the_nearest_documented_one(vers, nearest):
    assert nearest_documented(vers) == nearest


@pytest.mark.parametrize("vers", [0, 61, 200])
def test_sensor_has_one_table_for_every_version(vers):
    table = numbers(Device.SENSOR, vers)
    assert [table[n] for n in ("SG1", "FX", "TZ", "FT", "GM", "T3", "A")] == [
        *(42, 48, 53, 54, 58, 63, 64)
    ]


def test_a_sleeping_puck_has_only_monitor_properties():
    assert sorted(numbers(Device.MONITOR).values()) == list(range(11))


def test_one_property_number_has_a_different_meaning_on_each_device():
    kinds = (Device.MOTOR, Device.SAFETY, Device.SENSOR)
    assert [names(kind, 200)[42] for kind in kinds] == ["T", "ZERO", "SG1"]


@pytest.mark.parametrize("vers", [61, 65, 125, 132, 175, 200])
def test_a_property_number_has_one_meaning_except_for_the_alias(vers):
    ordered = sorted(numbers(Device.MOTOR, vers).values())
    duplicates = [n for n, m in pairwise(ordered) if n == m]
    assert duplicates == [17]  # FET1 is also called TENSION


def test_32_bit_properties_are_followed_by_a_free_number():
    table = names(Device.MOTOR, 200)
    wide = [n for n, name in table.items() if is_wide(name)]
    assert len(wide) == 13
    assert not any(n + 1 in table for n in wide)


@pytest.mark.parametrize(
    ("role", "stat", "expected"),
    [
        (0x0100, 2, Device.MOTOR),
        (PuckRole.BHAND, 2, Device.MOTOR),
        (0x0002, 2, Device.SAFETY),
        (0x0006, 2, Device.SENSOR),
        (0x0100, 0, Device.MONITOR),
        (0x001F, 2, None),
    ],
)
def test_role_selects_the_table_unless_the_device_sleeps(role, stat, expected):
    assert device_of(role, stat) is expected
