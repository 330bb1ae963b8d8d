import io
import os
import select
import termios

import pytest

from acquisition.clock import Readable
from acquisition.errors import LinkError
from ft_sensor.serial_line.link import SerialLink, latency_timer_warning, open_port


class ScriptedPort:
    """A port that returns its stored bytes, or raises a scripted error."""

    def __init__(self, held: bytes = b"", error: Exception | None = None) -> None:
        self.held = held
        self.error = error
        self.written = b""
        self.closed = 0

    def _fail(self) -> None:
        if self.error is not None:
            raise self.error

    @property
    def in_waiting(self) -> int:
        self._fail()
        return len(self.held)

    def read(self, size: int = 1, /) -> bytes:
        self._fail()
        taken, self.held = self.held[:size], self.held[size:]
        return taken

    def write(self, data: bytes, /) -> int:
        self._fail()
        self.written += data
        return len(data)

    def reset_input_buffer(self) -> None:
        self._fail()
        self.held = b""

    def fileno(self) -> int:
        raise io.UnsupportedOperation

    def close(self) -> None:
        self.closed += 1
        self._fail()


@pytest.fixture
def terminal():
    """(master descriptor, path) of a pseudo-terminal."""
    master, slave = os.openpty()
    path = os.ttyname(slave)
    yield master, path
    os.close(slave)
    os.close(master)


def test_link_is_readable_in_the_sense_of_the_clock():
    assert isinstance(SerialLink(ScriptedPort()), Readable)


def test_reading_returns_available_bytes_without_waiting():
    link = SerialLink(ScriptedPort(b"abc"))
    assert link.is_readable()
    assert link.read_available() == b"abc"
    assert not link.is_readable()
    assert link.read_available() == b""


def test_one_read_is_bounded():
    link = SerialLink(ScriptedPort(b"x" * 5000))
    assert len(link.read_available()) == 4096
    assert len(link.read_available()) == 904


def test_discarding_empties_the_input():
    link = SerialLink(ScriptedPort(b"old"))
    link.discard_input()
    assert link.read_available() == b""


def test_a_port_without_a_descriptor_has_descriptor_minus_one():
    assert SerialLink(ScriptedPort()).fileno() == -1


@pytest.mark.parametrize("error", [OSError(5, "gone"), termios.error(5, "gone")])
@pytest.mark.parametrize(
    "use",
    [
        SerialLink.read_available,
        SerialLink.is_readable,
        SerialLink.discard_input,
        lambda link: link.write(b"C"),
    ],
)
def test_a_failing_port_suggests_a_check_of_the_plug(error, use):
    link = SerialLink(ScriptedPort(error=error))
    with pytest.raises(LinkError, match="Unplugged"):
        use(link)


def test_closing_twice_closes_once_and_never_raises():
    port = ScriptedPort(error=OSError(5, "gone"))
    link = SerialLink(port)
    link.close()
    link.close()
    assert port.closed == 1


def test_a_closed_link_refuses_to_read():
    link = SerialLink(ScriptedPort(b"abc"))
    link.close()
    with pytest.raises(LinkError, match="closed"):
        link.read_available()


def test_missing_device_is_a_link_error_with_a_hint(tmp_path):
    with pytest.raises(LinkError, match="none") as error:
        open_port(str(tmp_path / "none"), 460800)
    assert "plugged in" in error.value.hint


def test_bytes_travel_through_a_real_terminal(terminal):
    master, path = terminal
    opened = open_port(path, 460800)
    link = SerialLink(opened.port)
    try:
        assert link.fileno() >= 0
        os.write(master, b"\xaa\x03\x0d")
        select.select([link.fileno()], [], [], 5.0)  # the kernel passes them on
        assert link.read_available() == b"\xaa\x03\x0d"
        link.write(b"C")
        assert os.read(master, 10) == b"C"
    finally:
        link.close()


def test_missing_low_latency_mode_is_a_warning(terminal):
    opened = open_port(terminal[1], 460800)
    opened.port.close()
    assert "low-latency" in opened.warning


def test_a_port_in_use_is_refused(terminal):
    first = open_port(terminal[1], 460800)
    try:
        with pytest.raises(LinkError, match="Cannot open"):
            open_port(terminal[1], 460800)
    finally:
        first.port.close()


@pytest.mark.parametrize(
    ("text", "is_warned"), [("16\n", True), ("1\n", False), ("what", False)]
)
def test_the_latency_timer_is_read_back(tmp_path, text, is_warned):
    folder = tmp_path / "ttyUSB0" / "device"
    folder.mkdir(parents=True)
    (folder / "latency_timer").write_text(text)
    warning = latency_timer_warning("/dev/ttyUSB0", tmp_path)
    assert ("latency timer 16 ms" in warning) == is_warned


def test_an_adapter_without_latency_timer_gives_no_warning(tmp_path):
    assert latency_timer_warning("/dev/ttyACM0", tmp_path) == ""
