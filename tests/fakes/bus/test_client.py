import socket
import tomllib
from collections import deque
from importlib.metadata import EntryPoint
from itertools import repeat
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.clock import SystemClock
from acquisition.errors import SettingsError
from fakes.bus.client import SocketBus, open_socket, pack_frame, unpack_frame
from fakes.bus.hub import CLIENTS, SocketHub
from wam.bus.link import CanLink
from wam.bus.transports import open_transport

QUESTION = pack_frame(0x404, b"\x30")


def message(can_id, data=b"\x05", **flags):
    flags.setdefault("is_extended_id", False)
    return can.Message(arbitration_id=can_id, data=data, **flags)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "bus"


@pytest.fixture
def hub(path):
    hub = SocketHub(path)
    yield hub
    hub.close()


@pytest.fixture
def join(hub, path):
    """Return a function that adds a client of python-can."""
    buses = []

    def make(**settings):
        buses.append(SocketBus(str(path), **settings))
        hub.receive()
        return buses[-1]

    yield make
    for bus in buses:
        bus.shutdown()


@pytest.fixture
def intruder(hub, path):
    """Return a plain socket that may send anything."""
    with open_socket() as plain:
        plain.connect(str(path))
        hub.receive()
        yield plain


def test_a_packet_has_the_linux_can_frame_layout():
    known = bytes.fromhex("26040000 04 000000 8500020000000000")
    assert pack_frame(0x426, bytes.fromhex("85000200")) == known


@given(st.integers(0, 0x7FF), st.binary(max_size=8))
def test_a_frame_round_trips_through_a_packet(can_id, data):
    assert unpack_frame(pack_frame(can_id, data)) == (can_id, data)


@given(st.binary(max_size=40))
def test_no_packet_decodes_to_an_impossible_frame(packet):
    frame = unpack_frame(packet)
    assert frame is None or (frame[0] <= 0x7FF and len(frame[1]) <= 8)


@pytest.mark.parametrize(
    "packet",
    [
        b"\x05",
        QUESTION[:-1],
        QUESTION + b"\0",
        pack_frame(0x404 | 1 << 31, b"\x30"),
        pack_frame(0x404 | 1 << 30, b""),
        pack_frame(0x404 | 1 << 29, b""),
        QUESTION[:4] + b"\x09" + QUESTION[5:],
    ],
)
def test_the_hub_ignores_and_counts_other_frames(hub, intruder, packet):
    intruder.send(packet)
    intruder.send(QUESTION)
    assert hub.receive() == [(0x404, b"\x30")]
    assert hub.ignored == 1


def test_a_frame_of_a_client_reaches_the_network_and_the_others_only(hub, join):
    first, second = join(), join()
    first.send(message(1))
    assert hub.receive() == [(1, b"\x05")]
    assert second.recv(0).arbitration_id == 1
    assert first.recv(0) is None


def test_a_frame_of_the_network_reaches_every_client(hub, join):
    clients = [join(), join()]
    hub.send(0x426, b"\x85\x00\x02\x00")
    assert [bus.recv(0).arbitration_id for bus in clients] == [0x426, 0x426]


def test_the_hub_is_readable_when_a_client_sends(hub, join):
    bus = join()
    assert not hub.is_readable()
    bus.send(message(1))
    assert hub.is_readable()


def test_a_client_that_never_reads_only_loses_its_own_frames(hub, join):
    join()
    while hub.lost == 0:
        hub.send(0x426, b"\x85\x00\x02\x00")
    late = join()
    hub.send(0x446, b"")
    assert late.recv(0).arbitration_id == 0x446


def test_a_client_that_leaves_is_forgotten(hub, join):
    join().shutdown()
    stays = join()
    hub.receive()
    hub.send(0x426, b"")
    assert stays.recv(0).arbitration_id == 0x426
    assert not hub.is_readable()


def test_too_many_clients_are_refused(hub, join):
    for _ in range(CLIENTS):
        join()
    extra = join()
    with pytest.raises(can.CanOperationError, match="has ended"):
        extra.recv(0)


def test_the_bus_ignores_and_counts_hostile_packets(path):
    with open_socket() as listener:
        listener.bind(str(path))
        listener.listen()
        with SocketBus(str(path)) as bus:
            server, _ = listener.accept()
            with server:
                server.send(b"\x01\x02")
                server.send(QUESTION)
                assert bus.recv(0).arbitration_id == 0x404
            assert bus.ignored == 1


def test_a_receive_without_time_out_does_not_wait(join):
    assert join().recv(0) is None


def test_a_receive_with_time_out_waits_for_the_frame(hub, join):
    bus = join()
    assert bus.recv(0.01) is None
    hub.send(0x426, b"")
    assert bus.recv(30.0).arbitration_id == 0x426  # the frame has already arrived


def test_filters_of_python_can_are_respected(hub, join):
    bus = join(can_filters=[{"can_id": 0x426, "can_mask": 0x7FF}])
    hub.send(0x446, b"")
    hub.send(0x426, b"")
    assert bus.recv(1.0).arbitration_id == 0x426


def test_an_ended_bus_is_reported(hub, join):
    bus = join()
    hub.close()
    with pytest.raises(can.CanOperationError, match="has ended"):
        bus.recv(0)
    with pytest.raises(can.CanOperationError, match="has ended"):
        bus.send(message(1))


def test_a_server_that_does_not_read_fills_the_buffer(join):
    bus = join()
    frame = message(1)
    with pytest.raises(can.CanOperationError, match="full"):
        deque(map(bus.send, repeat(frame)), maxlen=0)


def test_a_frame_of_can_fd_is_refused(join):
    with pytest.raises(ValueError, match="classic"):
        join().send(can.Message(arbitration_id=1, is_fd=True, is_extended_id=False))


def test_a_bus_has_a_descriptor_until_it_is_shut_down(join):
    bus = join()
    assert bus.fileno() >= 0
    bus.shutdown()
    bus.shutdown()
    assert bus.fileno() == -1


def test_a_bus_without_a_server_cannot_be_opened(path):
    with pytest.raises(can.CanInitializationError, match="no server at"):
        SocketBus(str(path))


def test_python_can_finds_the_bus_by_its_entry_point():
    project = tomllib.loads(Path("pyproject.toml").read_text())["project"]
    value = project["entry-points"]["can.interface"]["traction-fake"]
    assert EntryPoint("traction-fake", value, "can.interface").load() is SocketBus


def test_the_driver_opens_the_bus_like_any_other(hub, path, monkeypatch):
    backend = ("fakes.bus.client", "SocketBus")
    monkeypatch.setitem(can.interfaces.BACKENDS, "traction-fake", backend)
    monkeypatch.setattr(can.util, "VALID_INTERFACES", {"traction-fake"})
    link = CanLink(open_transport("traction-fake", str(path), 1_000_000, SystemClock()))
    hub.receive()
    link.send(0x404, b"\x30")
    assert hub.receive() == [(0x404, b"\x30")]
    hub.send(0x423, b"\0\0\0")
    assert [frame.can_id for frame in link.receive()] == [0x423]
    link.close()


def test_the_socket_is_removed_at_the_end(path):
    hub = SocketHub(path)
    assert path.is_socket()
    hub.close()
    hub.close()
    assert not path.exists()


def test_only_the_owner_may_connect(hub, path):
    assert path.stat().st_mode & 0o077 == 0


def test_a_path_in_use_is_refused(hub, path):
    with pytest.raises(SettingsError, match="in use"):
        SocketHub(path)
    assert path.is_socket()


def test_a_stale_socket_is_taken_over(path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as dead:
        dead.bind(str(path))
    hub = SocketHub(path)
    assert path.is_socket()
    hub.close()
    assert not path.exists()


def test_another_file_is_never_replaced(path):
    path.write_text("precious")
    with pytest.raises(SettingsError, match="not a socket"):
        SocketHub(path)
    assert path.read_text() == "precious"


def test_a_path_that_is_too_long_is_refused_with_its_length(tmp_path):
    with pytest.raises(SettingsError, match="107"):
        SocketHub(tmp_path / ("x" * 120))


def test_a_folder_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="No bus can be served"):
        SocketHub(tmp_path / "nowhere" / "bus")
