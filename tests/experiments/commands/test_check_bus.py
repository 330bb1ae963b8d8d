"""`traction check --bus` names the traffic on a bus and sends nothing."""

import threading
from pathlib import Path

import can
import pytest

from acquisition.clock import SystemClock
from acquisition.errors import LinkError
from fakes.bus.hub import SocketHub
from tests.experiments.program import traction, write_config
from wam.bus.decoder import describe_id
from wam.bus.log import BusTraffic
from wam.bus.transports import PythonCanTransport


@pytest.mark.parametrize(
    ("can_id", "words"),
    [
        (0x404, "host to the arm"),
        (0x401, "host to pucks 1-4"),
        (0x00A, "host to safety module"),
        (0x003, "host to puck 3"),
        (0x463, "puck 3 reports its position"),
        (0x426, "puck 1 answers"),
        (0x50A, "F/T sensor reports its force"),
        (0x540, "safety module to every puck"),
        (0x7FF, "node 31 to group 31"),
    ],
)
def test_an_identifier_is_described(can_id, words):
    assert describe_id(can_id) == words


def test_the_load_of_a_bus_follows_from_its_frames():
    traffic = BusTraffic()
    # A cycle of the arm: request, seven positions, two torques, 500 times a second.
    cycle = [(0x404, b"\x30", 0.0), *[(0x463, bytes(3), 0.0)] * 7]
    cycle += [(0x401, bytes(8), 0.0)] * 2
    for _ in range(500):
        traffic(cycle)
    assert traffic.load(1.0, 1_000_000) == pytest.approx(0.42, abs=0.03)
    assert traffic.counts[0x463] == 3500


class Talker:
    """A hub that sends a frame of each identifier every 5 ms."""

    def __init__(self, path: Path, ids: tuple[int, ...]) -> None:
        self._hub, self._ids, self._is_on = SocketHub(path), ids, True
        self.heard: list[int] = []
        self._thread = threading.Thread(target=self._talk)
        self._thread.start()

    def _talk(self) -> None:
        while self._is_on:
            self.heard += [can_id for can_id, _ in self._hub.receive()]
            for can_id in self._ids:
                self._hub.send(can_id, b"\0\0\1")
            SystemClock().sleep_until(SystemClock().now_ns() + 5_000_000)
        self._hub.close()

    def end(self) -> None:
        self._is_on = False
        self._thread.join()


def listen(tmp_path, *ids):
    talker = Talker(tmp_path / "bus", ids)
    try:
        config = write_config(tmp_path, rig=('"socketcan" ', '"traction-fake" '))
        text = config.read_text().replace('"can0"', f'"{tmp_path}/bus"')
        config.write_text(text)
        done = traction("check", "--bus", 0.3, "--config", config)
    finally:
        talker.end()
    assert talker.heard == []  # nothing was sent
    return done


def test_traffic_is_listed_with_sender_and_rate(tmp_path):
    done = listen(tmp_path, 0x463)
    assert done.code == 0
    assert "puck 3 reports its position" in done.out
    assert "frames/s" in done.out
    assert "masters" in done.out
    assert "another program" not in done.out


def test_another_master_is_reported(tmp_path):
    done = listen(tmp_path, 0x463, 0x404)
    assert "another program drives the arm: 404" in done.out


def test_a_silent_bus_is_reported(tmp_path):
    assert "silent, as an arm is while no host polls it" in listen(tmp_path).out


class DeafBus(can.BusABC):
    """A bus whose controller reports missing acknowledgement, or that is broken."""

    channel_info = "deaf"

    def __init__(self, is_broken=False):
        self._left = [can.Message(arbitration_id=0x204, is_error_frame=True)]
        self._left[0].data = bytearray((0, 0x20, 0, 0, 0, 0, 130, 0))
        self._is_broken = is_broken

    def send(self, msg, timeout=None):
        raise AssertionError("nothing is sent")

    def recv(self, timeout=None):
        if self._is_broken:
            raise can.CanOperationError("Network is down", 100)
        return self._left.pop() if self._left else None

    def fileno(self):
        raise NotImplementedError

    def shutdown(self):
        self._is_shutdown = True


@pytest.fixture
def served_by(monkeypatch):
    def serve(bus):
        transport = PythonCanTransport(bus, SystemClock())
        monkeypatch.setattr("wam.bus.transports.open_transport", lambda *_: transport)

    return serve


def test_an_error_frame_of_the_controller_is_reported_with_its_meaning(served_by):
    served_by(DeafBus())
    done = traction("check", "--bus", 0.1)
    assert "passive 1. No device on the CAN bus acknowledges." in done.out


def test_a_bus_that_breaks_ends_with_its_exit_code(served_by):
    served_by(DeafBus(is_broken=True))
    done = traction("check", "--bus", 0.1)
    assert done.code == LinkError.exit_code
    assert "Network is down" in done.err


def test_a_simulated_bus_cannot_be_listened_to():
    done = traction("check", "--bus", 1, "--fake")
    assert done.code == 2
    assert "traction fake" in done.err


@pytest.mark.parametrize("seconds", ["0", "-1", "nan", "1e9", "soon"])
def test_an_invalid_listening_time_is_refused(seconds):
    assert traction("check", f"--bus={seconds}").code == 2
