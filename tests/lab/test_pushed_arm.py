"""The laboratory's served arm, on stepped time and a bus of this test."""

import argparse

import pytest

from acquisition import PERIOD_NS
from lab.guest import machine_room, pushed_arm
from wam.bus import Device, Group, encode_get, group_id, property_number

_ASKED_NS = 60_000  # into a cycle
_CYCLES = 20


class Bus:
    """A clock, and a host that asks for positions in every cycle."""

    def __init__(self):
        self.t_ns = PERIOD_NS * 1000
        self.wakes = 0
        self.asked_ns = self.t_ns + _ASKED_NS
        self.sent: list[tuple[int, int]] = []
        self.number = property_number(Device.MOTOR, "P", 200)

    def now_ns(self):
        return self.t_ns

    def wait(self, _, deadline_ns):
        self.wakes += 1
        self.t_ns = max(self.t_ns, min(self.asked_ns, deadline_ns))

    def receive(self):
        if self.t_ns < self.asked_ns:
            return []
        self.asked_ns += PERIOD_NS
        return [(group_id(Group.ARM), encode_get(self.number))]

    def send(self, can_id, _):
        self.sent.append((self.t_ns, can_id))


@pytest.fixture
def bus(monkeypatch):
    bus = Bus()
    monkeypatch.setattr(pushed_arm, "SystemClock", lambda: bus)
    monkeypatch.setattr(pushed_arm, "open_can_port", lambda *_: bus)
    monkeypatch.setenv("TRACTION_DYNAMICS", "pinocchio")
    return bus


@pytest.fixture
def arm(bus, tmp_path):
    room = machine_room.MachineRoom("test")
    room.folder = tmp_path
    room.write_bus_config()
    options = argparse.Namespace(
        config=room.config, row="TF", seed=1, bus="socketcan:can1", line=None
    )
    return pushed_arm.PushedArm(options)


def test_seven_positions_leave_together_within_a_cycle(arm, bus):
    arm.do("lift")
    first_ns = bus.asked_ns
    end_ns = bus.t_ns + _CYCLES * PERIOD_NS
    while bus.t_ns < end_ns:
        arm.step()
    assert len(bus.sent) == 7 * _CYCLES
    for cycle in range(_CYCLES):
        times, _ = zip(*bus.sent[7 * cycle : 7 * cycle + 7], strict=True)
        assert len(set(times)) == 1
        # as long as the wire needs, before the loop looks for them
        assert 500_000 < times[0] - first_ns - cycle * PERIOD_NS < 700_000
    assert bus.wakes <= 3 * _CYCLES + 1
