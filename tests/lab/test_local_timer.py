"""Only the timer of a known kernel is corrected, through QEMU's gdb stub."""

import socket
import struct
import threading

import pytest

from lab.local_timer import DebuggerError, Rate, correct

EVENTS, OFFSETS, AREA = 0x1FDC0, 0xFFFF_FFFF_8241_CB60, 0xFFFF_8880_BC80_0000
DEVICE = AREA + EVENTS
FACTOR, LONGEST = 268_434_382, 34_359_875_825


class Stub:
    """A gdb stub with a few bytes of memory, halted when the debugger connects."""

    def __init__(self, path, factor=FACTOR, shift=32):
        self.memory = {OFFSETS: struct.pack("<Q", AREA)}
        self.memory[DEVICE] = struct.pack("<32xQQII", LONGEST, 1000, factor, shift)
        self.written = {}
        self.is_detached = False
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        link, _ = self._listener.accept()
        with link, self._listener:
            link.sendall(_packet("T05thread:01;"))
            data = b""
            while more := link.recv(4096):
                data += more
                while b"#" in data:
                    text, data = data.split(b"#", 1)
                    link.sendall(b"+" + _packet(self._answer(text.split(b"$")[1])))

    def _answer(self, text):
        command, _, rest = text.decode().partition(":")
        numbers = [int(word, 16) for word in command[1:].split(",") if word]
        if command[0] == "m":
            return self.memory[numbers[0]][: numbers[1]].hex()
        if command[0] == "M":
            self.written[numbers[0]] = bytes.fromhex(rest)
        self.is_detached = command[0] == "D"
        return "OK"

    def close(self):
        self._thread.join(5.0)


def _packet(text):
    return b"$%s#%02x" % (text.encode(), sum(text.encode()) % 256)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "debugger"


def test_the_timer_of_a_slowed_kernel_is_scaled(path):
    stub = Stub(path)
    correct(path, EVENTS, OFFSETS, 6)
    stub.close()
    assert stub.is_detached
    assert stub.written == {
        DEVICE + 32: struct.pack("<Q", LONGEST // 6),
        DEVICE + 48: struct.pack("<I", 6 * FACTOR),
    }


@pytest.mark.parametrize("other", [{"shift": 22}, {"factor": 0}, {"factor": 2**31}])
def test_another_kernel_is_not_changed(path, other):
    stub = Stub(path, **other)
    with pytest.raises(DebuggerError, match="not as expected"):
        correct(path, EVENTS, OFFSETS, 6)
    stub.close()
    assert stub.is_detached
    assert not stub.written


def test_the_longest_wait_still_fits_the_timer():
    slowed = Rate(LONGEST, FACTOR, 32).slowed(6)
    assert slowed.longest * slowed.factor >> 32 < 2**32
