import errno

import can
import pytest

from acquisition.clock import Readable
from acquisition.devices import BusCondition
from acquisition.errors import LinkError, LinkFullError
from tests.fakes.stepped import Rig, SteppedClock
from wam.bus import transports
from wam.bus.link import CanLink
from wam.bus.socketcan import InterfaceState, setup_command
from wam.bus.transports import PythonCanTransport, open_bus


class ScriptedBus(can.BusABC):
    """A bus that yields scripted messages, or raises a scripted error."""

    def __init__(self, messages=(), error=None):
        self.messages = list(messages)
        self.error = error
        self.channel_info = "can0"
        self.shutdowns = 0
        super().__init__(channel="can0")

    def send(self, msg, timeout=None):
        if self.error:
            raise self.error

    def _recv_internal(self, timeout):
        if self.error:
            raise self.error
        return (self.messages.pop(0) if self.messages else None), True

    def fileno(self):
        return 7

    def shutdown(self):
        self.shutdowns += 1
        super().shutdown()


def opened_link(bus, tap=None):
    return CanLink(PythonCanTransport(bus, SteppedClock()), tap)


def message(can_id, data=b"\x85\x00\x02\x00", **flags):
    flags.setdefault("is_extended_id", False)
    return can.Message(arbitration_id=can_id, data=data, **flags)


@pytest.fixture
def opened(monkeypatch):
    def make(bus, is_up=True):
        state = InterfaceState(is_up, has_carrier=True, queue_length=10)
        monkeypatch.setattr(transports, "interface_state", lambda _: state)

        def factory(**_):
            if isinstance(bus, Exception):
                raise bus
            return bus

        monkeypatch.setattr(transports.can, "Bus", factory)
        return lambda: open_bus("socketcan", "can0", 1_000_000)

    return make


def test_an_interface_that_is_down_is_reported_with_the_remedy(opened):
    with pytest.raises(LinkError) as caught:
        opened(RuntimeError("opened all the same"), is_up=False)()
    assert caught.value.message == "can0 is down."
    assert setup_command("can0", 1_000_000) in caught.value.hint


def test_an_interface_that_is_missing_is_reported(opened):
    with pytest.raises(LinkError, match="can0 does not exist"):
        opened(OSError(errno.ENODEV, "No such device"))()


@pytest.mark.parametrize(
    "error",
    [
        can.CanInitializationError("no adapter"),
        can.CanInterfaceNotImplementedError("unknown"),
        ValueError("bad channel"),
    ],
)
def test_every_failure_to_open_is_a_link_error(opened, error):
    with pytest.raises(LinkError, match="cannot be opened"):
        opened(error)()


def test_an_opened_bus_keeps_frames_that_already_arrived(opened):
    bus = ScriptedBus([message(0x040, is_error_frame=True)])
    assert opened(bus)() is bus
    link = opened_link(bus)
    link.receive()
    assert link.errors.condition is BusCondition.OFF
    link.close()


def test_only_data_frames_of_devices_are_passed_on():
    bus = ScriptedBus(
        [
            message(0x001),
            message(0x404, b"\x30"),
            message(0x426),
            message(0x546, is_remote_frame=True, data=None),
            message(0x546, is_extended_id=True),
            message(0x020, is_error_frame=True),
            message(0x546),
        ]
    )
    link = opened_link(bus)
    assert [frame.can_id for frame in link.receive()] == [0x426, 0x546]
    assert link.errors.frames == 1
    link.close()


def test_the_broadcast_of_the_safety_module_is_only_a_hint():
    link = opened_link(ScriptedBus([message(0x540)]))
    assert link.receive() == []
    assert link.mode_hints == 1
    link.close()


def test_polling_keeps_received_frames_for_the_reader():
    link = opened_link(ScriptedBus([message(0x426)]))
    assert link.is_readable()
    assert len(link.receive()) == 1
    assert not link.is_readable()
    link.close()


def test_a_flood_does_not_block_the_reader():
    link = opened_link(ScriptedBus([message(0x426)] * 2000))
    assert 0 < len(link.receive()) < 1000
    link.close()


def test_an_error_found_by_polling_is_raised_to_the_reader():
    bus = ScriptedBus(error=can.CanOperationError("Network is down", errno.ENETDOWN))
    link = opened_link(bus)
    assert not link.is_readable()
    bus.error = None  # Linux reports it once
    with pytest.raises(LinkError, match="Network is down"):
        link.receive()
    assert link.receive() == []
    link.close()


def test_a_broken_bus_raises_a_link_error_and_is_never_readable():
    bus = ScriptedBus(error=can.CanOperationError("Network is down", errno.ENETDOWN))
    link = opened_link(bus)
    assert not link.is_readable()
    with pytest.raises(LinkError, match="failed"):
        link.receive()
    with pytest.raises(LinkError, match="failed"):
        link.send(1, b"\x05")
    link.close()


@pytest.mark.parametrize(
    "error",
    [
        can.CanOperationError("Transmit buffer full"),
        can.CanOperationError("Failed to transmit", errno.ENOBUFS),
        can.CanOperationError("Failed to transmit", errno.EAGAIN),
        OSError(errno.ENOBUFS, "No buffer space available"),
    ],
)
def test_a_full_queue_is_recognised_by_its_error_number(error):
    link = opened_link(ScriptedBus(error=error))
    with pytest.raises(LinkFullError, match="send queue is full") as refused:
        link.send(1, b"\x05")
    assert "acknowledges" in str(refused.value)
    link.close()


def test_closing_twice_shuts_the_bus_down_once():
    bus = ScriptedBus()
    link = opened_link(bus)
    link.close()
    link.close()
    assert bus.shutdowns == 1
    assert link.fileno() == -1
    assert link.receive() == []
    with pytest.raises(LinkError, match="closed"):
        link.send(1, b"\x05")


def test_a_link_has_the_file_descriptor_of_its_bus():
    link = opened_link(ScriptedBus())
    assert link.fileno() == 7
    assert isinstance(link, Readable)
    assert Rig().link.fileno() == -1
    link.close()


def test_a_tap_gets_all_data_frames_sent_and_received():
    heard = []
    bus = ScriptedBus(
        [
            message(0x426),
            message(0x540),
            message(0x404),
            message(1, is_error_frame=True),
        ]
    )
    link = opened_link(bus, heard.extend)
    link.send(1, b"\x05")
    assert [frame.can_id for frame in link.receive()] == [0x426]
    assert [can_id for can_id, _, _ in heard] == [1, 0x426, 0x540, 0x404]
    assert heard[0] == (1, b"\x05", 0)
    link.close()


def test_a_tap_gets_frames_received_before_the_bus_broke():
    class Breaking(ScriptedBus):
        def _recv_internal(self, timeout):
            if not self.messages:
                raise can.CanOperationError("gone", errno.ENETDOWN)
            return super()._recv_internal(timeout)

    heard = []
    link = opened_link(Breaking([message(0x426)]), heard.extend)
    assert [frame.can_id for frame in link.receive()] == [0x426]
    with pytest.raises(LinkError):
        link.receive()
    assert [can_id for can_id, _, _ in heard] == [0x426]
    link.close()


def test_the_first_frame_of_another_master_is_kept():
    arrived = [message(0x426), message(0x404, b"\x30"), message(0x00A, b"\x08")]
    link = opened_link(ScriptedBus(arrived))
    assert link.foreign_id is None
    link.receive()
    assert link.foreign_id == 0x404
    assert link.foreign_ids == {0x404, 0x00A}
    link.close()


@pytest.mark.parametrize("can_id", [0x021, 0x281, 0x4E1, 0x682, 0x684, 0x283 | 0x400])
def test_another_master_with_its_own_node_is_detected(can_id):
    link = opened_link(ScriptedBus([message(0x426), message(can_id, b"\x30")]))
    assert [frame.can_id for frame in link.receive()] == [0x426]
    assert link.foreign_id == can_id
    link.close()


def test_interface_setup_restarts_the_bus_and_queues_one_cycle():
    words = setup_command("can1", 500_000).split()
    assert words[:5] == ["ip", "link", "set", "can1", "up"]
    kind = words.index("type")  # the options of the controller follow
    assert words[5:kind] == ["txqueuelen", "16"]
    assert words[kind:] == [
        *("type", "can", "bitrate", "500000"),
        *("restart-ms", "100"),
    ]
