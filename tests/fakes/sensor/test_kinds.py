from fakes.sensor.kinds import SERIAL_KINDS
from ft_sensor.vendors.registry import SECTIONS


def test_every_make_with_a_serial_line_can_be_simulated():
    on_line = {
        kind
        for kind, section in SECTIONS.items()
        if section.model_fields["port"].is_required()
    }
    assert set(SERIAL_KINDS) == on_line
