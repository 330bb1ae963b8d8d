from fakes.sensor import kinds
from ft_sensor.vendors import registry


def test_every_serial_sensor_can_be_simulated():
    assert set(kinds.SERIAL_KINDS) == set(registry.SERIAL_KINDS)
