import pytest

from acquisition.errors import LinkError
from fakes.sensor.port import FakeSerialPort
from ft_sensor.serial_line.link import SerialLink


class Time:
    def __init__(self) -> None:
        self.now = 0

    def now_ns(self) -> int:
        return self.now

    def utc_ns(self) -> int:
        return self.now

    def sleep_until(self, t_ns: int) -> None:
        self.now = t_ns

    def wait(self, link, deadline_ns: int) -> bool:
        self.now = deadline_ns
        return link.is_readable()


class Ticker:
    """Sends one letter every 10 ns and stores the bytes that it receives."""

    def __init__(self) -> None:
        self.sent_ns = 0
        self.received: list[tuple[int, bytes]] = []
        self.opened_ns: list[int] = []

    def port_opened(self, t_ns: int) -> None:
        self.opened_ns.append(t_ns)

    def receive(self, t_ns: int, data: bytes) -> None:
        self.received.append((t_ns, data))

    def due(self, t_ns: int) -> list[tuple[int, bytes]]:
        gone = [(t, b"x") for t in range(self.sent_ns + 10, t_ns + 1, 10)]
        self.sent_ns += 10 * len(gone)
        return gone

    def next_event_ns(self) -> int | None:
        return self.sent_ns + 10


@pytest.fixture
def time():
    return Time()


@pytest.fixture
def ticker():
    return Ticker()


def test_bytes_arrive_when_they_are_due(ticker, time):
    port = FakeSerialPort(ticker, time)
    time.now = 9
    assert port.in_waiting == 0
    time.now = 25
    assert port.in_waiting == 2
    assert port.read(1) == b"x"
    assert port.read(100) == b"x"
    assert port.read(100) == b""


def test_opening_discards_earlier_bytes(ticker, time):
    time.now = 1000
    port = FakeSerialPort(ticker, time)
    assert ticker.opened_ns == [1000]
    assert port.in_waiting == 0


def test_written_bytes_reach_the_device_now(ticker, time):
    port = FakeSerialPort(ticker, time)
    time.now = 30
    assert port.write(b"C") == 1
    assert ticker.received == [(30, b"C")]


def test_next_event_is_that_of_the_device(ticker, time):
    port = FakeSerialPort(ticker, time)
    time.now = 20
    assert port.in_waiting == 2
    assert port.next_event_ns() == 30


def test_unread_bytes_are_lost_and_counted(ticker, time):
    port = FakeSerialPort(ticker, time)
    time.now = 50_000
    assert port.in_waiting == 4096
    assert port.overrun == 5000 - 4096


def test_resetting_empties_the_buffer(ticker, time):
    port = FakeSerialPort(ticker, time)
    time.now = 50
    port.reset_input_buffer()
    assert port.in_waiting == 0


def test_a_wrong_baud_rate_garbles_both_directions(ticker, time):
    port = FakeSerialPort(ticker, time, line_xor=0xFF)
    port.write(b"C")
    time.now = 10
    assert ticker.received == [(0, bytes((ord("C") ^ 0xFF,)))]
    assert port.read(1) == bytes((ord("x") ^ 0xFF,))


def test_a_simulated_port_has_no_descriptor(ticker, time):
    assert SerialLink(FakeSerialPort(ticker, time)).fileno() == -1


def test_unplugging_breaks_the_link(ticker, time):
    port = FakeSerialPort(ticker, time)
    link = SerialLink(port)
    port.unplug()
    with pytest.raises(LinkError, match="Unplugged"):
        link.read_available()
    link.close()


def test_a_closed_port_refuses_and_discards_bytes(ticker, time):
    port = FakeSerialPort(ticker, time)
    port.close()
    port.close()
    port.advance(100)
    assert ticker.sent_ns == 100
    with pytest.raises(OSError, match="Input/output"):
        port.read(1)
