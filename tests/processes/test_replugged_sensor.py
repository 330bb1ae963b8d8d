"""A serial sensor in its own process is unplugged and plugged in again."""

import pytest

from experiments.rig.requests import OpenSensor, StartArm
from experiments.rig.rig import FakeOptions, build_rig
from experiments.settings.load import load_settings
from tests.processes.watching import until

pytestmark = pytest.mark.wall_clock
ROW = "S0"
FRESH_NS = 50_000_000
FOUND_AGAIN = 25.0  # s; boot text, start-up, rate check, on a machine with other work


@pytest.fixture
def rig():
    settings = load_settings(None)
    rig = build_rig(settings, settings.row(ROW), FakeOptions("processes", seed=1))
    yield rig
    rig.backend.close()


def is_fresh(rig):
    newest = rig.shared.wrenches.last(1)
    if not len(newest):
        return False
    age_ns = rig.clock.now_ns() - int(newest["t_ns"][0])
    return bool(newest["is_valid"][0]) and age_ns < FRESH_NS


def test_a_sensor_is_read_again_after_it_was_unplugged(rig):
    rig.backend.ask(StartArm())
    fields = rig.backend.ask(OpenSensor())
    assert until(lambda: is_fresh(rig), 2)
    rig.simulation.inject("ft-unplugged")
    assert until(lambda: not is_fresh(rig), 2)
    assert until(lambda: "serial port" in trouble(rig), 3), trouble(rig)
    rig.simulation.clear_faults()
    assert until(lambda: is_fresh(rig), FOUND_AGAIN), trouble(rig)
    assert rig.backend.sensor_metadata()["reopened"] == "1"
    assert rig.backend.ask(OpenSensor())["model"] == fields["model"]


def trouble(rig):
    return rig.backend.sensor_metadata()["trouble"]
