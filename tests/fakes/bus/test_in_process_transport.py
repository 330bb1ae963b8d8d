"""The in-process transport gives the same frames and errors as python-can."""

import pytest

from acquisition.errors import LinkError
from fakes.bus.in_process import InProcessTransport
from tests.fakes.stepped import Rig
from wam.bus.transports import PythonCanTransport

MS = 1_000_000
POSITIONS, VERS, PUCK = 0x404, b"\x00", 1


class Ends:
    """A transport to its own network, with a log of its frames and errors."""

    def __init__(self, make):
        self.rig = Rig()
        self.transport = make(self.rig.bus, self.rig.clock)
        self.faults = self.rig.network.faults
        self.log = []

    def say(self, can_id=POSITIONS, data=b"\x30"):
        try:
            self.transport.send(can_id, data)
        except LinkError as error:
            self.log.append((type(error), str(error)))

    def hear(self, wait_ns=2 * MS):
        self.rig.rest(wait_ns)
        try:
            self.log.append([tuple(frame) for frame in self.transport.receive()])
        except LinkError as error:
            self.log.append((type(error), str(error)))


def a_cycle(ends):
    ends.say()
    ends.hear(400_000)
    ends.hear()
    ends.hear(0)
    ends.say(PUCK, VERS)
    ends.say(PUCK, b"\x05")
    ends.hear()


def an_interface_that_is_down(ends):
    ends.say()
    ends.rig.rest(MS)
    ends.faults.go_down()
    ends.say()
    ends.hear()
    ends.faults.clear_faults()
    a_cycle(ends)


def a_controller_that_leaves_the_bus(ends):
    ends.faults.go_off()
    a_cycle(ends)
    ends.faults.clear_faults()
    a_cycle(ends)


def a_torn_cable(ends):
    ends.faults.stop_acknowledging()
    for _ in range(13):
        ends.say()
    ends.hear()
    ends.faults.clear_faults()
    ends.hear()
    a_cycle(ends)


def an_error_frame_among_frames(ends):
    ends.say()
    ends.rig.rest(MS)
    ends.faults.report_error(0x004, bytes(8))
    ends.hear(0)
    a_cycle(ends)


def frames_that_waited_for_a_minute(ends):
    ends.say()
    ends.rig.rest(60_000 * MS)
    ends.hear(0)


def more_frames_than_are_drained_at_once(ends):
    for _ in range(80):
        ends.say()
        ends.rig.rest(2 * MS)
    ends.hear(0)
    ends.hear(0)


def an_error_behind_frames(ends):
    """Take the interface down while its frames are read, and restore it."""
    ends.say()
    ends.rig.rest(2 * MS)
    receive, faults = ends.rig.bus.recv, ends.faults
    ends.faults.report_error(0x004, bytes(8))  # python-can is used from here on

    def recv(timeout=None):
        message = receive(timeout)
        if message is not None and message.arbitration_id == 0x446:
            faults.is_down = True
        return message

    ends.rig.bus.recv = recv
    ends.hear(0)
    faults.is_down = False
    ends.hear(0)
    ends.hear(0)


def filters(ends):
    ends.rig.bus.set_filters([{"can_id": 0x426, "can_mask": 0x7FF}])
    a_cycle(ends)


def a_bus_that_was_shut_down(ends):
    ends.transport.close()
    ends.say()
    ends.hear()


@pytest.mark.parametrize(
    "happen",
    [
        a_cycle,
        an_interface_that_is_down,
        a_controller_that_leaves_the_bus,
        a_torn_cable,
        an_error_frame_among_frames,
        frames_that_waited_for_a_minute,
        more_frames_than_are_drained_at_once,
        an_error_behind_frames,
        filters,
        a_bus_that_was_shut_down,
    ],
)
def test_both_transports_give_the_same_frames_and_errors(happen):
    short, long = Ends(InProcessTransport), Ends(PythonCanTransport)
    happen(short)
    happen(long)
    assert short.log == long.log
    assert any(short.log) or happen is a_bus_that_was_shut_down


def test_a_sound_bus_is_used_without_python_can_messages(monkeypatch):
    ends = Ends(InProcessTransport)
    for method in ("send", "recv"):
        monkeypatch.setattr(ends.rig.bus, method, None)
    a_cycle(ends)
    assert [len(frames) for frames in ends.log] == [3, 4, 0, 2]
