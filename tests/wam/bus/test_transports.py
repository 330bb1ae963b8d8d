import contextlib
import ctypes
import errno
import socket
import struct
from pathlib import Path

import can
import pytest

from acquisition.errors import LinkError, LinkFullError
from tests.fakes.stepped import SteppedClock
from tests.wam.bus.test_link import ScriptedBus, message
from wam.bus import datagrams, transports
from wam.bus.datagrams import MAX_DATAGRAMS, system_call
from wam.bus.link import CanLink
from wam.bus.socketcan import (
    AdapterClock,
    InterfaceState,
    SocketcanTransport,
    interface_state,
)
from wam.bus.transports import PythonCanTransport, open_transport

NS_PER_S = 1_000_000_000
MS = 1_000_000
AHEAD_NS = 1_000_000 * NS_PER_S  # of UTC before the monotonic clock


def can_frame(can_id, data=b"", length=None):
    return struct.pack("=IB3x8s", can_id, len(data) if length is None else length, data)


class OffsetClock(SteppedClock):
    """A clock whose UTC is a million seconds ahead of its monotonic time."""

    def utc_ns(self):
        return self.t_ns + AHEAD_NS


@pytest.fixture
def pair():
    """A transport, and the other end of the datagram socket that replaces its bus."""
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    transport = SocketcanTransport(near, "can0", SteppedClock(), system_call())
    yield transport, far
    transport.close()
    far.close()


def ancillary(kind, data, level=socket.SOL_SOCKET):
    part = struct.pack("@Nii", 16 + len(data), level, kind) + data
    return part + bytes(-len(part) % 8)


def stamps(software_ns=0, hardware_ns=0):
    parts = (*divmod(software_ns, NS_PER_S), 0, 0, *divmod(hardware_ns, NS_PER_S))
    return ancillary(37, struct.pack("@6q", *parts))


def lost(total):
    return ancillary(40, struct.pack("=I", total))


class ScriptedCalls:
    """Scripted recvmmsg(2): (frame, ancillary bytes), with errors between them.

    Writes frames into the caller's memory, as the kernel does.
    """

    def __init__(self, *script):
        self.script = list(script)
        self.calls = 0

    def __call__(self, descriptor, headers, room, flags, timeout):
        assert flags == socket.MSG_DONTWAIT
        assert timeout is None
        self.calls += 1
        given = 0
        while self.script and given < room:
            if isinstance(self.script[0], Exception):
                break
            self._give(headers.value + 64 * given, *self.script.pop(0))
            given += 1
        if given:
            return given
        error = self.script.pop(0) if self.script else BlockingIOError(errno.EAGAIN)
        ctypes.set_errno(error.errno or error.args[0])
        return -1

    @staticmethod
    def _give(header, frame, ancillary):
        fields = struct.unpack("@PIPNPNi0P", ctypes.string_at(header, 56))
        _, _, iovec, _, control, control_room, _ = fields
        assert control_room == 128  # the sizes of the last call are reset
        address, room = struct.unpack("@PN", ctypes.string_at(iovec, 16))
        size = min(len(frame), room)
        ctypes.memmove(address, frame, size)
        ctypes.memmove(control, ancillary, len(ancillary))
        ctypes.memmove(header + 40, struct.pack("@N", len(ancillary)), 8)
        ctypes.memmove(header + 56, struct.pack("@I", size), 4)


class OldSocket:
    """A socket without options."""

    def fileno(self):
        return -1

    def send(self, frame):
        raise OSError(errno.EBADF, "no descriptor")

    def setblocking(self, flag):
        pass

    def setsockopt(self, *option):
        raise OSError(errno.ENOPROTOOPT, "of an old kernel")

    def getsockopt(self, *option):
        raise OSError(errno.ENOPROTOOPT, "of an old kernel")


def scripted(*script, clock=None):
    calls = ScriptedCalls(*script)
    return SocketcanTransport(OldSocket(), "can0", clock or OffsetClock(), calls)


def test_sent_frames_have_the_linux_can_layout(pair):
    transport, far = pair
    transport.send(0x404, b"\x30")
    transport.send(0x408, bytes(range(8)))
    assert far.recv(99) == bytes.fromhex("04040000 01000000 3000000000000000")
    assert far.recv(99) == bytes.fromhex("08040000 08000000 0001020304050607")


def test_received_frames_keep_their_order_length_and_flags(pair):
    transport, far = pair
    for frame in (
        can_frame(0x426, b"\x00\x01\x02"),
        can_frame(0x20000040, bytes(8)),
        can_frame(0x80000426, b"\x01"),
        can_frame(0x40000426),
    ):
        far.send(frame)
    assert [(f.can_id, f.data) for f in transport.receive()] == [
        (0x426, b"\x00\x01\x02"),
        (0x20000040, bytes(8)),
        (0x80000426, b"\x01"),
        (0x40000426, b""),
    ]
    assert transport.receive() == []


def test_a_link_sorts_data_frames_from_error_frames(pair):
    transport, far = pair
    link = CanLink(transport)
    for frame in (
        can_frame(0x20000004, bytes((0, 4, 0, 0, 0, 0, 0, 0))),
        can_frame(0x80000426, b"\x01"),
        can_frame(0x40000426),
        can_frame(0x404, b"\x30"),
        can_frame(0x540),
        can_frame(0x426, b"\x07"),
    ):
        far.send(frame)
    assert [(f.can_id, f.data) for f in link.receive()] == [(0x426, b"\x07")]
    assert (link.errors.text(), link.foreign_id, link.mode_hints) == (
        "warning 1",
        0x404,
        1,
    )


def test_a_flood_of_error_frames_is_sorted_once_and_hides_no_frame():
    heard = []
    flood = [(can_frame(0x20000088, bytes(8)), b"")] * 200
    link = CanLink(scripted(*flood, (can_frame(0x426, b"\x07"), b"")), heard.append)
    assert [frame.can_id for frame in link.receive()] == [0x426]
    assert link.errors.frames == 200
    assert [[can_id for can_id, _, _ in frames] for frames in heard] == [[0x426]]


@pytest.mark.parametrize("size", [0, 1, 15])
def test_a_datagram_that_is_not_a_frame_is_dropped(pair, size):
    transport, far = pair
    far.send(bytes(size))
    far.send(can_frame(0x426, b"\x07"))
    assert [frame.can_id for frame in transport.receive()] == [0x426]


def test_a_length_beyond_eight_bytes_reads_only_the_bytes_present(pair):
    transport, far = pair
    far.send(can_frame(0x426, bytes(8), length=200))
    assert [len(frame.data) for frame in transport.receive()] == [8]


def test_unsent_frames_are_detected(pair):
    transport, far = pair
    assert not transport.has_unsent()
    transport.send(0x404, b"\x30")
    assert transport.has_unsent()
    far.recv(99)
    assert not transport.has_unsent()


def test_a_kernel_without_a_send_queue_count_does_not_stop_torques():
    assert not scripted().has_unsent()


def test_a_full_queue_is_distinguished_from_a_broken_bus(pair):
    transport, far = pair
    with pytest.raises(LinkFullError):
        flood(transport)
    far.close()
    with pytest.raises(LinkError) as broke:
        transport.send(0x404, b"\x30")
    assert not isinstance(broke.value, LinkFullError)


def flood(transport):
    for _ in range(10_000):
        transport.send(0x404, b"\x30")


def test_a_flood_does_not_block_the_reader():
    arrived = (can_frame(0x426, b"\x07"), b"")
    transport = scripted(*[arrived] * 2000)
    assert 0 < len(transport.receive()) < 1000


@pytest.mark.parametrize("make", ["kernel", "python-can"])
def test_neither_an_error_nor_the_frames_before_it_are_lost(make):
    if make == "kernel":
        down = OSError(errno.ENETDOWN, "Network is down")
        transport = scripted((can_frame(0x426, b"\x07"), b""), down)
    else:
        bus = ScriptedBus([message(0x426)])
        down = can.CanOperationError("Network is down", errno.ENETDOWN)
        bus.recv = lambda _: breaking(bus, down)
        transport = PythonCanTransport(bus, SteppedClock())
    assert [frame.can_id for frame in transport.receive()] == [0x426]
    with pytest.raises(LinkError, match="Network is down"):
        transport.receive()
    if make == "kernel":
        assert transport.receive() == []  # Linux reports it once
    else:
        bus.shutdown()


def breaking(bus, error):
    if bus.messages:
        return bus.messages.pop(0)
    raise error


def test_frames_lost_on_the_socket_are_counted():
    transport = scripted(
        (can_frame(1), b""), (can_frame(2), lost(7)), (can_frame(3), b"")
    )
    assert transport.lost == 0
    transport.receive()
    assert transport.lost == 7
    assert CanLink(transport).metadata()["link:lost_frames"] == "7"


def test_kernel_time_stamps_are_on_the_host_clock():
    clock = OffsetClock()
    transport = scripted(
        (can_frame(1), stamps(clock.utc_ns() - 3 * MS)),
        (can_frame(2), b""),
        (can_frame(3), stamps()),
        (can_frame(4), ancillary(37, b"short")),
        (can_frame(5), stamps(clock.utc_ns() + NS_PER_S)),  # the future
        (can_frame(6), stamps(clock.utc_ns() - 60 * NS_PER_S)),
        clock=clock,
    )
    assert [f.t_ns for f in transport.receive()] == [clock.t_ns - 3 * MS, 0, 0, 0, 0, 0]
    assert transport.name == "kernel socket"


def test_a_time_stamp_and_a_drop_count_are_read_together():
    clock = OffsetClock()
    transport = scripted(
        (can_frame(1), stamps(clock.utc_ns() - 3 * MS) + lost(9)),
        (can_frame(2), lost(11) + stamps(clock.utc_ns() - 2 * MS)),
        clock=clock,
    )
    ages = [clock.t_ns - frame.t_ns for frame in transport.receive()]
    assert (ages, transport.lost) == ([3 * MS, 2 * MS], 11)


@pytest.mark.parametrize(
    "damaged",
    [
        struct.pack("@Nii", 0, socket.SOL_SOCKET, 37) + bytes(48),
        struct.pack("@Nii", 2**63, socket.SOL_SOCKET, 40) + bytes(48),
        struct.pack("@Nii", 100, socket.SOL_SOCKET, 40) + bytes(8),
        ancillary(40, bytes(4), level=socket.IPPROTO_UDP),
        ancillary(40, bytes(3)),
        bytes(7),
        bytes(128),
    ],
)
def test_unknown_ancillary_data_is_ignored(damaged):
    transport = scripted((can_frame(1, b"\x07"), damaged), (can_frame(2), b""))
    frames = [(f.can_id, f.data, f.t_ns) for f in transport.receive()]
    assert frames == [(1, b"\x07", 0), (2, b"", 0)]
    assert transport.lost == 0


def test_more_frames_than_one_call_takes_keep_their_order(pair):
    transport, far = pair
    far.setblocking(False)
    sent = []
    with contextlib.suppress(BlockingIOError):  # on systems with a short queue
        for number in range(100):
            far.send(can_frame(0x426, bytes([number])))
            sent.append(number)
    arrived = []
    while frames := transport.receive():
        arrived += [frame.data[0] for frame in frames]
    assert arrived == sent


def test_an_error_behind_a_full_call_is_not_lost():
    down = OSError(errno.ENETDOWN, "Network is down")
    frames = [(can_frame(i), b"") for i in range(MAX_DATAGRAMS)]
    transport = scripted(*frames, down, (can_frame(77), b""))
    assert [frame.can_id for frame in transport.receive()] == list(range(MAX_DATAGRAMS))
    with pytest.raises(LinkError, match="Network is down"):
        transport.receive()
    assert [frame.can_id for frame in transport.receive()] == [77]


def test_a_call_that_drained_the_socket_is_not_repeated():
    calls = ScriptedCalls(*[(can_frame(i), b"") for i in range(9)])
    transport = SocketcanTransport(OldSocket(), "can0", OffsetClock(), calls)
    assert len(transport.receive()) == 9
    assert calls.calls == 1


def test_a_closed_transport_does_not_read_a_reused_descriptor(pair):
    transport, far = pair
    far.send(can_frame(0x426))
    transport.close()
    with pytest.raises(LinkError):
        transport.receive()


def test_a_c_library_without_recvmmsg_is_reported(monkeypatch):
    monkeypatch.setattr(datagrams.ctypes, "CDLL", lambda *_, **__: object())
    with pytest.raises(OSError, match="recvmmsg"):
        system_call()


def test_adapter_time_stamps_keep_the_spacing_of_frames():
    clock = OffsetClock()
    utc_ns, own_ns = clock.utc_ns() - 10 * MS, 77 * MS  # it counts from its start
    delays = (900_000, 200_000, 1_500_000, 200_000)
    rows = [
        (can_frame(i), stamps(utc_ns + i * MS + delay, own_ns + i * MS))
        for i, delay in enumerate(delays)
    ]
    transport = scripted(*rows, clock=clock)
    times = [frame.t_ns for frame in transport.receive()]
    assert times[2] - times[1] == pytest.approx(MS, abs=1000)
    assert times[3] - times[2] == pytest.approx(MS, abs=1000)
    assert "adapter" in transport.name


def test_a_drifting_adapter_clock_is_tracked():
    clock, drift = AdapterClock(), 50e-6
    for second in range(3600):
        kernel_ns = AHEAD_NS + second * NS_PER_S
        own_ns = round(second * NS_PER_S * (1 - drift))
        error_ns = clock.utc_ns(kernel_ns + 200_000, own_ns) - kernel_ns
    assert abs(error_ns) < MS


@pytest.mark.parametrize("step_ns", [4295 * NS_PER_S, -4295 * NS_PER_S, 100 * MS])
def test_a_clock_that_is_set_or_wraps_is_synchronised_again(step_ns):
    clock = AdapterClock()
    clock.utc_ns(AHEAD_NS, 5 * NS_PER_S)
    kernel_ns = AHEAD_NS + NS_PER_S
    assert clock.utc_ns(kernel_ns, 6 * NS_PER_S + step_ns) == kernel_ns


def test_an_adapter_time_stamp_needs_an_earlier_kernel_time_stamp():
    clock = AdapterClock()
    assert clock.utc_ns(0, 5 * NS_PER_S) == 0
    clock.utc_ns(AHEAD_NS, 5 * NS_PER_S)
    assert clock.utc_ns(0, 6 * NS_PER_S) == AHEAD_NS + NS_PER_S


@pytest.mark.parametrize(
    ("stamp", "expected_ns"),
    [
        (0.0, 0),  # none
        (0.999, 999 * MS),  # the monotonic clock
        (1_000_000.998, 998 * MS),  # UTC
        (5000.0, 0),  # a clock of the adapter's own
        (1.5, 0),  # the future
    ],
)
def test_a_python_can_time_stamp_is_used_if_plausible(stamp, expected_ns):
    transport = PythonCanTransport(
        ScriptedBus([message(0x426, timestamp=stamp)]), OffsetClock()
    )
    (frame,) = transport.receive()
    # A double holds UTC seconds to a quarter of a microsecond.
    assert frame.t_ns == pytest.approx(expected_ns, abs=1000)


@pytest.mark.parametrize("channel", ["", "nocan17", "a-name-that-is-too-long", "a\0b"])
def test_a_missing_interface_is_refused(channel):
    with pytest.raises(OSError, match="No such device") as refused:
        interface_state(channel)
    assert refused.value.errno == errno.ENODEV
    with pytest.raises(LinkError, match="does not exist"):
        open_transport("socketcan", channel, 1_000_000, SteppedClock())


def test_an_existing_interface_has_a_state():
    name = socket.if_nameindex()[0][1]
    sysfs = Path("/sys/class/net", name)
    flags = int((sysfs / "flags").read_text(), 16)
    state = interface_state(name)
    assert state.is_up == bool(flags & 1)
    assert state.queue_length == int((sysfs / "tx_queue_len").read_text())


def test_an_interface_that_is_down_is_not_opened(monkeypatch):
    down = InterfaceState(is_up=False, has_carrier=False, queue_length=10)
    monkeypatch.setattr(transports, "interface_state", lambda _: down)
    with pytest.raises(LinkError, match="can0 is down"):
        open_transport("socketcan", "can0", 1_000_000, SteppedClock())


def test_other_adapters_are_opened_through_python_can(monkeypatch):
    bus = ScriptedBus()
    monkeypatch.setattr(transports.can, "Bus", lambda **_: bus)
    transport = open_transport("pcan", "PCAN_USBBUS1", 1_000_000, SteppedClock())
    assert transport.name == "python-can"
    transport.close()
    assert bus.shutdowns == 1
