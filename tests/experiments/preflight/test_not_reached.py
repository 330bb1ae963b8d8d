"""The refusal of an arm that is not reached over SocketCAN names what helps."""

import pytest

from acquisition.errors import LinkError, LinkFullError, PreflightError
from experiments.preflight import connecting
from experiments.settings.load import load_settings
from wam.bus.socketcan import setup_command


def refusal(error, monkeypatch):
    def fail(*_):
        raise error

    monkeypatch.setattr(connecting, "build_rig", fail)
    settings = load_settings(None)
    assert settings.rig.can.interface == "socketcan"
    with pytest.raises(PreflightError) as refused:
        connecting.connect_rig(settings, settings.matrix.terrains[0], None)
    return str(refused.value)


def test_an_interface_that_is_down_is_reported_with_its_setup_command(monkeypatch):
    text = refusal(LinkError("can0 is down."), monkeypatch)
    assert setup_command("can0", 1_000_000) in text


def test_a_full_queue_is_not_reported_as_a_missing_adapter(monkeypatch):
    full = LinkFullError("The queue is full.", hint="Nobody acknowledges.")
    text = refusal(full, monkeypatch)
    assert "Nobody acknowledges." in text
    assert "plugged in" not in text
