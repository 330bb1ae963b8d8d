"""A rig can be built from the settings of the loop benchmark."""

from benchmarks.realtime import settings_with_bus_sensor
from experiments.settings.calibrations import with_calibrations


def test_the_rig_of_the_benchmark_has_its_sensor_on_the_bus():
    settings = settings_with_bus_sensor()
    built = with_calibrations(settings, is_simulated=True)
    assert built.rig.ft_sensor.kind == "barrett"
