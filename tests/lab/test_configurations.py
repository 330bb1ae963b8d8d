"""Scenarios write the shipped configurations with the intended changes."""

import pytest

from experiments.settings.load import load_settings
from lab.guest.commands import ScenarioError
from lab.guest.machine_room import TRAVEL, MachineRoom
from lab.guest.scenarios.serial_line import MAKES, write_make


@pytest.fixture
def room(tmp_path):
    room = MachineRoom("test")
    room.folder = tmp_path
    return room


def test_a_sensor_on_the_bus_needs_no_port(room):
    room.write_bus_config()
    settings = load_settings(room.config)
    assert settings.rig.ft_sensor.kind == "barrett"
    assert settings.rig.can.interface == "socketcan"


def test_the_container_and_the_loop_test_are_short(room):
    room.write_bus_config()
    settings = load_settings(room.config)
    assert settings.rig.loop.test_time == 0.5
    assert {row.travel for row in settings.matrix.terrains} == {TRAVEL}


@pytest.mark.parametrize("make", MAKES, ids=lambda make: f"{make.kind} {make.baudrate}")
def test_each_make_is_configured_at_its_speed(room, make):
    write_make(room, make)
    sensor = load_settings(room.config).rig.ft_sensor
    assert (sensor.kind, sensor.baudrate) == (make.kind, make.baudrate)


def test_a_change_of_a_line_missing_in_the_shipped_file_is_refused(room):
    with pytest.raises(ScenarioError, match="no such line"):
        room.write_config({"no such line": "anything"})
