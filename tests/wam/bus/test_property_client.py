import pytest

from acquisition.errors import LinkTimeoutError
from tests.fakes.stepped import Rig
from wam.bus.frames import Group
from wam.bus.property_client import PropertyClient


def test_a_request_returns_the_value_of_its_reply():
    rig = Rig()
    assert PropertyClient(rig.link, rig.clock).get(7, 90) == 6
    assert rig.sent[-1][1:] == (0x007, b"\x5a")


def test_a_reply_to_another_request_is_not_accepted():
    rig = Rig()
    properties = PropertyClient(rig.link, rig.clock)
    rig.link.send(1, b"\x56")  # IPNM of puck 1
    rig.link.send(2, b"\x44")  # CTS of puck 2
    assert properties.get(1, 68) == 4096
    rig.rest(1_000_000)
    properties.drain()
    assert properties.late_replies == 2


def test_silence_yields_no_value_after_the_timeout():
    rig = Rig()
    begin_ns = rig.clock.t_ns
    assert PropertyClient(rig.link, rig.clock).get(20, 5, 1_000_000) is None
    assert rig.clock.t_ns - begin_ns == 1_000_000


def test_a_missing_required_reply_names_node_and_property():
    rig = Rig()
    with pytest.raises(LinkTimeoutError, match=r"Node 9 .* GET CTS \(68\)"):
        PropertyClient(rig.link, rig.clock).require(9, 68, "CTS")


def test_a_group_command_uses_the_group_identifier():
    rig = Rig()
    PropertyClient(rig.link, rig.clock).set_group(Group.ARM, 8, 0)
    assert rig.sent[-1][1:] == (0x404, bytes.fromhex("88 00 00 00 00 00"))
