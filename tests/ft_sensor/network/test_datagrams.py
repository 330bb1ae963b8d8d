"""Datagrams of a network sensor are read despite loss, reordering and damage."""

import socket
from contextlib import closing

import numpy as np
import pytest

from acquisition.clock import SystemClock
from acquisition.errors import LinkError, SettingsError
from fakes.sensor.ati import COUNTS, RANGES, AtiOptions, ati_stream
from fakes.sensor.network import LossyNetwork, UdpDevice
from ft_sensor.network.datagrams import DatagramPort, SensorAddress, parse_address
from ft_sensor.serial_line.link import PortSettings, SerialLink
from ft_sensor.serial_line.reconnect import ReconnectingSensor
from ft_sensor.serial_line.sensor import SerialSensor
from ft_sensor.vendors import ati
from ft_sensor.vendors.ati import RdtRecord
from ft_sensor.vendors.ati_device import AtiDevice, AtiSettings
from tests.ft_sensor.sensor_bench import LOAD, MS, ChunkedPort, SensorBench

S = 1000 * MS


@pytest.fixture
def far_end():
    """A socket on loopback in the place of a sensor."""
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as end:
        end.bind(("127.0.0.1", 0))
        end.settimeout(1.0)
        yield end


@pytest.fixture
def port(far_end):
    with closing(DatagramPort(SensorAddress(*far_end.getsockname()), 36)) as opened:
        yield opened


def reader_of(far_end, port):
    """Let the port send its request, and return its address."""
    port.write(ati.encode_request(ati.STREAM))
    data, reader = far_end.recvfrom(100)
    assert ati.decode_request(data) == (ati.STREAM, 0)
    return reader


def test_datagrams_are_read_in_pieces(far_end, port):
    reader = reader_of(far_end, port)
    for k in range(3):
        far_end.sendto(bytes([k]) * 36, reader)
    far_end.sendto(b"short", reader)
    assert port.in_waiting == 108
    assert port.read(40) == bytes(36) + b"\1" * 4
    assert port.read(100) == b"\1" * 32 + b"\2" * 36
    assert port.strange == 1


def test_only_the_sensors_address_is_received(far_end, port):
    reader = reader_of(far_end, port)
    assert reader[0] == "127.0.0.1"
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as stranger:
        stranger.bind(("127.0.0.1", 0))
        stranger.sendto(bytes(36), reader)
    assert port.in_waiting == 0


def test_a_flood_is_bounded(far_end, port):
    reader = reader_of(far_end, port)
    for _ in range(400):
        far_end.sendto(bytes(36), reader)
    assert port.in_waiting <= 8192
    port.reset_input_buffer()
    assert port.in_waiting == 0


def read_often(link):
    for _ in range(1000):
        link.read_available()


def test_an_unreachable_address_is_a_link_error():
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as free:
        free.bind(("127.0.0.1", 0))
        address = SensorAddress(*free.getsockname())
    with closing(DatagramPort(address, 36)) as opened:
        opened.write(b"12345678")
        with pytest.raises(LinkError, match="Unplugged"):  # refused by the kernel
            read_often(SerialLink(opened))


@pytest.mark.parametrize(
    "text", ["", "sensor.local", "1.2.3", "192.168.1.1:0", "192.168.1.1:x", "::1"]
)
def test_an_invalid_address_is_refused(text):
    with pytest.raises(SettingsError, match="not an address"):
        parse_address(text, 49152)


@pytest.mark.parametrize("text", ["224.0.0.1", "0.0.0.0", "255.255.255.255"])
def test_an_address_of_several_hosts_is_refused(text):
    with pytest.raises(SettingsError, match="not the address of a single sensor"):
        parse_address(text, 49152)


def test_an_address_has_the_default_port_unless_stated():
    assert parse_address("192.168.1.1", 49152).text == "192.168.1.1:49152"
    assert parse_address("192.168.1.1:5000", 49152).port == 5000


def record(number, status=0, counts=(1, 2, 3, 4, 5, 6)):
    return ati.encode_record(RdtRecord(number, number, status, counts))


def scanned(*numbers, scanner=None):
    scanner = scanner or ati.RdtScanner((1.0,) * 6, (1e9,) * 6)
    found = [scanner.feed(b"".join(record(n) for n in group)) for group in numbers]
    return [[reading.ticks for reading in group] for group in found], scanner


def test_records_have_the_documented_bytes():
    assert ati.encode_request(ati.STREAM).hex() == "1234000200000000"
    assert ati.encode_request(ati.STOP, 1).hex() == "1234000000000001"
    data = record(1, 0x80020000, (-1, 2, 3, 4, 5, 6))
    assert data.hex() == "0000000100000001" + "80020000" + "ffffffff" + "".join(
        f"{k:08x}" for k in (2, 3, 4, 5, 6)
    )
    assert ati.decode_record(data).counts == (-1, 2, 3, 4, 5, 6)
    assert ati.decode_request(b"1234") is None


def test_packets_are_reordered_and_used_once():
    found, scanner = scanned([1, 2, 4, 3, 3], [3, 5, 5], [7, 6])
    assert found == [[1, 2, 3, 4], [5], [6, 7]]
    assert scanner.late == 3


def test_sequence_numbers_wrap():
    last = ati.MODULUS - 1
    found, _ = scanned([last - 1, 0, last], [1])
    assert found == [[last - 1, last, 0], [1]]


def test_packets_of_a_restarted_sensor_are_accepted():
    found, _ = scanned([5000, 5001], [1, 2], [3])
    assert found == [[5000, 5001], [1, 2], [3]]


@pytest.mark.parametrize(
    ("status", "is_trusted", "saturated"),
    [
        (0, True, 0),
        (1 << 16, True, 0),
        (1 << 31 | 1 << 17, True, 0x3F),
        (1 << 31, False, 0),
        (1 << 31 | 1 << 28, False, 0),
        (1 << 5, False, 0),
    ],
)
def test_status_bits_decide_validity(status, is_trusted, saturated):
    (reading,) = ati.RdtScanner((1.0,) * 6, (1e9,) * 6).feed(record(1, status))
    assert (reading.is_trusted, reading.saturated) == (is_trusted, saturated)
    assert bool(ati.status_texts(status)) == bool(status)


def lossy_bench(**shares):
    """Return an opened bench on a bad network, and the network."""
    networks = []

    def network(stream):
        networks.append(LossyNetwork(stream, np.random.default_rng(4), **shares))
        return networks[0]

    bench = SensorBench("ati", network=network).opened()
    bench.run(20 * MS)
    networks[0].counts = dict.fromkeys(networks[0].counts, 0)
    return bench, networks[0]


class FuzzedNetwork(LossyNetwork):
    """A network with random packets among those of the sensor, once `is_fuzzed`."""

    is_fuzzed = False
    asked_ns = 0

    def due(self, t_ns):
        packets = super().due(t_ns)
        if not self.is_fuzzed or t_ns == self.asked_ns:
            return packets
        self.asked_ns = t_ns
        rng = np.random.default_rng(t_ns)
        return [*packets, *((t_ns, rng.bytes(36)) for _ in range(rng.integers(4)))]


def test_a_poor_network_costs_only_the_lost_packets():
    bench, network = lossy_bench(lost=0.01, doubled=0.01, overtaken=0.01)
    before = bench.sensor.counters
    found = bench.run(10 * S)
    counters = bench.sensor.counters
    assert all(sample.is_valid for sample in found)
    dates = np.array([sample.t_ns for sample in found])
    assert (np.diff(dates) > 0).all()
    assert network.counts["lost"] > 50
    assert network.counts["doubled"] > 50
    assert network.counts["overtaken"] > 50
    # A packet overtaken by one of an earlier read is lost, too.
    assert network.counts["lost"] <= counters.lost - before.lost
    largest = network.counts["lost"] + network.counts["overtaken"]
    assert counters.lost - before.lost <= largest
    assert len(found) == len({sample.counter for sample in found})
    assert counters.jumps == 0
    mean = np.mean([sample.wrench for sample in found], axis=0)
    assert (np.abs(mean - LOAD) < np.repeat([1.3, 0.06], 3)).all()


def test_stale_samples_of_a_poor_network_are_always_flagged():
    bench, _ = lossy_bench(lost=0.01)
    ages = []
    for _ in range(2000):
        found = bench.run(2 * MS)
        if found:
            ages.append(bench.clock.now_ns() - found[-1].t_ns)
    assert max(ages) < 6 * MS


def test_fuzzed_packets_raise_no_error_and_absurd_values_are_invalid():
    networks = []

    def network(stream):
        networks.append(FuzzedNetwork(stream, np.random.default_rng(4)))
        return networks[0]

    bench = SensorBench("ati", network=network).opened()
    bench.run(20 * MS)
    networks[0].is_fuzzed = True
    found = bench.run(600 * MS)
    wrenches = np.array([sample.wrench for sample in found])
    wild = (np.abs(wrenches) > 4 * np.array(RANGES)).any(axis=1)
    assert wild.sum() > 100
    assert not any(s.is_valid for s, w in zip(found, wild, strict=True) if w)


@pytest.mark.slow
def test_a_repeatedly_unplugged_network_is_read_again():
    bench = SensorBench("ati")
    ports = []

    def connect():
        port = ChunkedPort(bench.device, bench.clock)
        bench.clock.world = port
        ports.append(port)
        device = AtiDevice(
            PortSettings("192.168.1.1", 100_000_000, 0.25), AtiSettings(*COUNTS, RANGES)
        )
        return SerialSensor(SerialLink(port), bench.clock, device)

    sensor = ReconnectingSensor(connect, bench.clock)
    sensor.open()

    def polled(duration_ns):
        end_ns, found = bench.clock.now_ns() + duration_ns, []
        while bench.clock.now_ns() < end_ns:
            bench.clock.sleep_until(bench.clock.now_ns() + 2 * MS)
            found += sensor.poll(bench.clock.now_ns())
        return found

    for k in range(20):
        assert any(sample.is_valid for sample in polled(100 * MS))
        bench.device.go_silent()  # UDP does not report an unplugged cable
        polled(400 * MS)
        assert sensor.sensor is None
        bench.device.speak()
        polled(6 * S)
        assert sensor.reopened == k + 1
    assert "250 ms" not in sensor.last_error


def test_a_sensor_on_loopback_is_opened_read_and_closed():
    clock = SystemClock()
    stream = ati_stream(lambda _: LOAD, None, AtiOptions(), clock.now_ns())
    with closing(UdpDevice(stream, clock.now_ns())) as device:
        address = parse_address(device.path, ati.PORT)
        with closing(DatagramPort(address, ati.FRAME_SIZE)) as port:
            link = SerialLink(port)
            link.write(ati.encode_request(ati.STREAM))
            found = []
            end_ns = clock.now_ns() + 2 * S
            scanner = ati.RdtScanner(AtiSettings(*COUNTS, RANGES).counts, RANGES)
            while len(found) < 20 and clock.now_ns() < end_ns:
                device.advance(clock.now_ns())
                found += scanner.feed(link.read_available())
            assert [reading.ticks for reading in found[:20]] == list(range(1, 21))
            assert found[0].wrench == pytest.approx(LOAD, abs=1e-5)
