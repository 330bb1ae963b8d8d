"""A companion device is polled with the positions and does not delay them."""

import numpy as np
import pytest

from acquisition.errors import LinkError
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.driver.arm import WamArm

CYCLE_NS = 2_000_000
FORCE, TORQUE = 0x50A, 0x50B


class RecordingDevice:
    """Requests the wrench and stores the frames that it receives."""

    def __init__(self):
        self.asked, self.heard = [], []

    def poll_frame(self, t_ns):
        self.asked.append(t_ns)
        return 8, b"\x36"

    def on_frame(self, can_id, data):
        self.heard.append((can_id, bytes(data)))


@pytest.fixture
def rig():
    return Rig(NetworkOptions(has_sensor=True))


@pytest.fixture
def listener():
    return RecordingDevice()


@pytest.fixture
def arm(rig, listener):
    arm = WamArm(rig.link, rig.clock)
    arm.start()
    arm.attach_device(listener)
    rig.sent.clear()
    return arm


def test_the_companion_is_polled_once_a_cycle_right_after_the_positions(
    rig, arm, listener
):
    begin_ns = rig.clock.t_ns
    arm.read(begin_ns)
    assert [(can_id, data) for _, can_id, data in rig.sent[:2]] == [
        (0x404, b"\x30"),
        (0x008, b"\x36"),
    ]
    assert listener.asked == [begin_ns]


def test_a_reading_does_not_wait_for_the_companion(rig, arm, listener):
    reading = arm.read(rig.clock.t_ns)
    assert reading.is_complete
    assert FORCE not in {can_id for can_id, _ in listener.heard}
    assert rig.clock.t_ns - reading.host_ns < 800_000  # the torque arrives at 0.87 ms


def test_replies_after_the_positions_are_read_in_the_next_cycle(rig, arm, listener):
    begin_ns = rig.clock.t_ns
    arm.read(begin_ns)
    rig.clock.sleep_until(begin_ns + CYCLE_NS)
    arm.read(begin_ns + CYCLE_NS)
    heard = [can_id for can_id, _ in listener.heard if can_id in (FORCE, TORQUE)]
    assert heard == [FORCE, TORQUE]


def test_the_companion_receives_no_positions(rig, arm, listener):
    for n in range(3):
        rig.clock.sleep_until(rig.clock.t_ns // CYCLE_NS * CYCLE_NS + CYCLE_NS)
        arm.read(rig.clock.t_ns)
        arm.send(np.zeros(7), np.zeros(7))
        assert n < 1 or listener.heard
    assert not [can_id for can_id, _ in listener.heard if can_id & 0x1F == 3]


def test_positions_are_kept_when_the_bus_refuses_the_companions_request(
    rig, arm, monkeypatch
):
    send = rig.link.send

    def refuse(can_id, data):
        if can_id == 8:
            raise LinkError("full")
        send(can_id, data)

    monkeypatch.setattr(rig.link, "send", refuse)
    assert arm.read(rig.clock.t_ns).is_complete
    assert arm.counters.link_errors == 1
