"""Registry of all makes of wrist sensors: the union of their settings.

A new make is a module with its section (a `SensorSection` with `kind`, options and
`build`) and a member here.
"""

from typing import get_args

from ft_sensor.section import SensorSection
from ft_sensor.vendors.ati_device import AtiSection
from ft_sensor.vendors.barrett import BarrettSection
from ft_sensor.vendors.bota_device import BotaSection
from ft_sensor.vendors.optoforce_device import OptoForceSection
from ft_sensor.vendors.robotous_device import RobotousSection

AnySensor = (
    BotaSection | RobotousSection | OptoForceSection | AtiSection | BarrettSection
)

SECTIONS: dict[str, type[SensorSection]] = {
    get_args(section.model_fields["kind"].annotation)[0]: section
    for section in get_args(AnySensor)
}
SERIAL_KINDS = tuple(  # with a port, not on the arm's bus
    kind
    for kind, section in SECTIONS.items()
    if section.model_fields["port"].is_required()
)
