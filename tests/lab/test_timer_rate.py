"""The debugger's side of the machine, played by a thread with a memory."""

import socket
import struct
import threading

import pytest

from lab.requirements import LabError
from lab.results import TimerAddresses
from lab.timer_rate import correct, packet, preset

OFFSETS, OFFSET, EVENTS = 0xFFFF_0000, 0xFFFF_8880_0000_0000, 0x1000
MULT = OFFSET + EVENTS + 48


class Stub:
    """Answers as a debugger's stub does: reports of a stop come unasked."""

    def __init__(self, path, mult):
        self.memory = {
            OFFSETS: struct.pack("<Q", OFFSET),
            MULT: struct.pack("<I", mult),
        }
        self.is_detached = False
        self.commands = []
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen()
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _serve(self):
        peer, _ = self._listener.accept()
        with peer, self._listener:
            peer.sendall(packet("T02thread:01;"))
            text = b""
            while not self.is_detached and (data := peer.recv(1)):
                text += data
                if text[-3:-2] == b"#":
                    peer.sendall(b"+")
                    answer = packet(self._answer(text[text.index(b"$") + 1 : -3]))
                    for byte in answer:
                        peer.sendall(bytes([byte]))
                    text = b""

    def _answer(self, command):
        name, rest = command[:1], command[1:].decode()
        self.commands.append(command.decode())
        if name in b"Zz":
            return "OK"
        if name == b"c":  # it runs into what was set before
            return "T05thread:01;"
        if name == b"D":
            self.is_detached = True
            return "OK"
        address, _, size = rest.partition(":")[0].partition(",")
        if name == b"M":
            self.memory[int(address, 16)] = bytes.fromhex(rest.partition(":")[2])
            return "OK"
        return self.memory[int(address, 16)][: int(size, 16)].hex()


def test_the_timer_counts_as_much_more_as_time_is_slower(tmp_path):
    stub = Stub(tmp_path / "gdb", 268_434_382)
    assert correct(tmp_path / "gdb", OFFSETS, EVENTS, 4) == (268_434_382, 1_073_737_528)
    stub.thread.join(10)
    assert struct.unpack("<I", stub.memory[MULT]) == (1_073_737_528,)


@pytest.mark.parametrize("mult", [0, 2**31])
def test_a_timer_that_cannot_be_one_is_left_alone(tmp_path, mult):
    stub = Stub(tmp_path / "gdb", mult)
    with pytest.raises(LabError):
        correct(tmp_path / "gdb", OFFSETS, EVENTS, 4)
    stub.thread.join(10)
    assert stub.is_detached
    assert struct.unpack("<I", stub.memory[MULT]) == (mult,)


def test_a_kernel_that_is_known_is_told_its_rate_before_it_measures_it(tmp_path):
    stub = Stub(tmp_path / "gdb", 1)
    preset(tmp_path / "gdb", TimerAddresses(OFFSETS, EVENTS, 0x5000, 0x6000), 6)
    stub.thread.join(10)
    # 1 GHz of a processor that is six times faster than time, 250 ticks a second.
    assert struct.unpack("<I", stub.memory[0x5000]) == (24_000_000,)
    set_up = [stub.commands.index(text) for text in ("Z1,6000,1", "c", "z1,6000,1")]
    assert set_up == sorted(set_up)
    assert stub.is_detached
