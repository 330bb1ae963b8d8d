"""A sample that is a multiple of the range of its sensor is not valid."""

import pytest

from fakes.clock import SteppedClock
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.serial_line.sensor import SerialSensor
from ft_sensor.vendors import bota, robotous
from ft_sensor.vendors.bota import BotaFrame
from ft_sensor.vendors.bota_device import BotaDevice, BotaSettings
from ft_sensor.vendors.robotous import RobotousFrame
from ft_sensor.vendors.robotous_device import RobotousDevice, RobotousSettings


class Line:
    """A line on which a frame has arrived."""

    def __init__(self, data):
        self.data = data

    def read_available(self):
        return self.data


def sample(device, data):
    sensor = SerialSensor(Line(data), SteppedClock(), device)
    (found,) = sensor.poll(10_000_000_000)
    return found


# RFT60-HA01, which measures up to 150 N along x and 4 N m: 50 and 2000 counts of each.
@pytest.mark.parametrize(
    ("axis", "counts", "is_valid"),
    [
        (0, 7_500, True),
        (0, 30_000, True),
        (0, 30_001, False),
        (1, -30_001, False),
        (3, 32_000, True),
        (4, -32_001, False),
        (5, -32_768, False),
    ],
)
def test_robotous_readings_are_plausible_up_to_a_multiple_of_the_range(
    axis, counts, is_valid
):
    numbers = [10, 20, 30, 40, 50, 60]
    numbers[axis] = counts
    data = robotous.encode_frame(RobotousFrame(tuple(numbers), 0))
    device = RobotousDevice(PortSettings("/dev/ttyUSB0", 921_600), RobotousSettings())
    assert sample(device, data).is_valid is is_valid


@pytest.mark.parametrize(("share", "is_valid"), [(3.99, True), (4.01, False)])
def test_bota_readings_are_plausible_up_to_a_multiple_of_the_range(share, is_valid):
    device = BotaDevice(PortSettings("/dev/ttyUSB0", 460_800), BotaSettings())
    wrench = (share * device.ranges[0], 0.1, 0.2, 0.3, 0.4, 0.5)
    data = bota.encode_frame(BotaFrame(0, wrench, 7, 25.0))
    assert sample(device, data).is_valid is is_valid
