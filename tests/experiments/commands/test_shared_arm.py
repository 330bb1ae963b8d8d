"""Commands refuse an arm that another program uses, and send no torque."""

import json
import os
import re
import signal
import subprocess
import sys
import threading

import pytest

from acquisition.clock import SystemClock
from acquisition.control_loop.realtime import RealtimeRequest, request
from acquisition.devices import SafetyMode
from experiments.rig.arm_lock import ArmLock
from fakes.bus.client import SocketBus
from fakes.bus.hub import SocketHub
from fakes.pucks.network import PuckNetwork
from fakes.pucks.options import NetworkOptions
from fakes.serving.puck_server import PuckServer
from tests.experiments.messages import pattern
from tests.experiments.program import served_config, traction
from tests.fakes.buses import COUNTS
from tests.fakes.stepped import Motors
from tests.wam.bus.test_link import message

# Messages of two programs on one arm; each has a test here.
SHARED_ARM = {"arm-busy", "arm-lock", "arm-active", "other-master"}
COMMANDS = {
    "check": ("check",),
    "bench": ("bench", "--seconds", 1),
    "zero": ("zero", "--yes"),
}
MODE_ASKED = (0x00A, b"\x08")
TORQUES = (" fake0 401#", " fake0 402#")
TRIES = 6
SET_MODE = " fake0 00A#88"


@pytest.fixture
def config(tmp_path):
    """Settings of a real rig whose bus is served at `tmp_path`/bus."""
    return served_config(tmp_path)


@pytest.fixture
def active_arm(tmp_path):
    """A served arm that is active, needs no heartbeat and records its frames."""
    clock = SystemClock()
    options = NetworkOptions(safety_mode=SafetyMode.ACTIVE, heartbeat_ns=10**15)
    motors = Motors(COUNTS)
    network = PuckNetwork(motors, options, clock.now_ns())
    server = PuckServer(network, motors, SocketHub(tmp_path / "bus"), clock)
    server.frames = []
    server.has_master = False
    other = SocketBus(str(tmp_path / "bus"))
    is_over = threading.Event()

    def serve():
        request(RealtimeRequest(60, None))  # if permitted: a busy machine stalls it
        while not is_over.is_set():
            server.step(lambda can_id, data: server.frames.append((can_id, data)))
            while other.recv(0) is not None:
                pass
            if server.has_master:  # at 1 kHz: this thread must not spin
                other.send(message(0x404, b"\x30"))
                clock.sleep_until(clock.now_ns() + 1_000_000)

    thread = threading.Thread(target=serve)
    thread.start()
    yield server
    is_over.set()
    thread.join()
    other.shutdown()
    server.close()


def refused(command, config, tmp_path, name):
    """Run `command`; its error output, which is the message `name`."""
    done = traction(*COMMANDS[command], "--config", config, "--data", tmp_path)
    assert done.code == 3, done.err
    assert name in SHARED_ARM
    assert re.search(pattern(name), done.err)
    return done.err


@pytest.mark.parametrize("command", COMMANDS)
def test_a_lock_that_is_not_a_file_is_refused(command, config, tmp_path):
    lock = ArmLock("traction-fake", str(tmp_path / "bus"))
    lock.close()
    lock.path.unlink()
    os.mkfifo(lock.path)
    try:
        assert str(lock.path) in refused(command, config, tmp_path, "arm-lock")
    finally:
        lock.path.unlink()


@pytest.mark.parametrize("command", COMMANDS)
def test_an_arm_locked_by_another_program_is_not_opened(command, config, tmp_path):
    lock = ArmLock("traction-fake", str(tmp_path / "bus"))
    try:
        err = refused(command, config, tmp_path, "arm-busy")
    finally:
        lock.close()
        lock.path.unlink()
    assert f"in use: process {os.getpid()}" in err


@pytest.mark.wall_clock
@pytest.mark.parametrize("command", COMMANDS)
def test_an_active_arm_is_only_asked_for_its_mode(
    command, config, tmp_path, active_arm
):
    refused(command, config, tmp_path, "arm-active")
    own = [frame for frame in active_arm.frames if frame[0] < 0x400]
    assert set(own) == {MODE_ASKED}
    assert active_arm.network.safety_mode is SafetyMode.ACTIVE


@pytest.mark.wall_clock
@pytest.mark.parametrize("command", COMMANDS)
def test_nothing_is_sent_to_the_arm_of_another_master(
    command, config, tmp_path, active_arm
):
    active_arm.has_master = True
    assert "404" in refused(command, config, tmp_path, "other-master")
    assert {can_id for can_id, _ in active_arm.frames if not can_id & 0x3E0} == {0x404}
    assert active_arm.network.safety_mode is SafetyMode.ACTIVE


def patiently(*arguments):
    """Repeat a command while the served arm, which is not real-time, seems silent."""
    for _ in range(TRIES):
        done = traction(*arguments)
        if done.code == 0:
            break
    assert done.code == 0, done.err
    return done


@pytest.mark.wall_clock
def test_zero_check_and_bench_send_no_torque_and_no_mode(config, tmp_path):
    log = tmp_path / "bus.log"
    served = subprocess.Popen(
        [
            *(sys.executable, "-m", "experiments", "fake", "--idle-first"),
            *("--can", f"traction-fake:{tmp_path}/bus", "--serial"),
            *(str(tmp_path / "sensor"), "--can-log", str(log)),
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    options = ("--config", config, "--data", tmp_path)
    try:
        assert served.stdout.readline().startswith("ready")
        patiently("zero", "--yes", *options)
        checked = patiently("check", "--loop-test", 0.5, *options)
        assert "No torque was sent" in checked.out
        timed = patiently("bench", "--seconds", 1, "--json", *options)
        assert not json.loads(timed.out)["is_powered"]
        served.send_signal(signal.SIGTERM)
        served.wait(30)
    finally:
        served.kill()
        served.communicate()
    text = log.read_text()
    assert text.count(" fake0 404#") > 500
    assert not [frame for frame in (*TORQUES, SET_MODE) if frame in text]


def test_a_simulated_check_sends_no_torque(config, tmp_path):
    log = tmp_path / "bus.log"
    options = ("--config", config, "--data", tmp_path)
    done = traction("check", "--fake", "--fast", "--can-log", log, *options)
    assert done.code == 0, done.err
    assert not [torque for torque in TORQUES if torque in log.read_text()]
