"""The served arm as another program sees it, in real time with generous limits."""

import os
import signal
import subprocess
import sys

import can
import pytest

from acquisition.clock import SystemClock
from fakes.bus.client import SocketBus, open_socket
from ft_sensor.serial_line.link import PortSettings, SerialLink, open_port
from ft_sensor.serial_line.sensor import SerialSensor
from tests.experiments.program import run_short, traction
from tests.ft_sensor.sensor_bench import MAKES

pytestmark = pytest.mark.slow

ABSENT = "23 did not come"  # of 31 nodes polled, seven pucks and the module answer
ANSWERS = f" 0 of them after more than 1 ms, {ABSENT}; 0 came without a request"
PATIENCE = 30.0  # s, for a machine that stalls; met at once on one that does not


@pytest.fixture
def serve(tmp_path):
    """A function that starts `traction fake` on the socket `tmp_path`/bus."""
    running = []

    def start(*arguments):
        command = [sys.executable, "-m", "experiments", "fake"]
        command += ["--can", f"traction-fake:{tmp_path}/bus", *map(str, arguments)]
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        running.append(process)
        return process, process.stdout.readline()

    yield start
    for process in running:
        process.kill()
        process.communicate()


def ask(bus, can_id, data):
    bus.send(can.Message(arbitration_id=can_id, is_extended_id=False, data=data))
    reply = bus.recv(PATIENCE)
    return reply.arbitration_id, bytes(reply.data).hex(" ")


def test_another_program_finds_the_arm_and_stdin_is_its_pendant(serve, tmp_path):
    log = tmp_path / "bus.log"
    process, ready = serve("--idle-first", "--can-log", log)
    assert ready == f"ready: traction-fake:{tmp_path}/bus, safety module in idle\n"
    with SocketBus(f"{tmp_path}/bus") as bus:
        assert ask(bus, 1, b"\x05") == (0x426, "85 00 00 00")
        assert ask(bus, 10, b"\x08") == (0x546, "88 00 01 00")
        process.stdin.write("fly\nestop\n")
        process.stdin.flush()
        assert bus.recv(PATIENCE).arbitration_id == 0x540
        assert ask(bus, 10, b"\x08") == (0x546, "88 00 00 00")
    out, err = process.communicate("quit\n", timeout=PATIENCE)
    assert (process.returncode, out) == (0, "")
    assert "'fly' is none of activate, idle, estop, quit" in err
    assert not (tmp_path / "bus").exists()
    words = traction("replay", "--can", log)
    assert words.code == 0
    assert "host asks puck 1 for STAT" in words.out
    assert "puck 1 answers STAT = 0 (reset)" in words.out
    assert "3 answers requested: 3 came" in words.out


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_service_cleanly(serve, tmp_path, number):
    process, ready = serve()
    assert "safety module in e-stop" in ready
    process.send_signal(number)
    assert process.wait(PATIENCE) == 0
    assert not (tmp_path / "bus").exists()


STARTS = {
    "background of a script": "{} </dev/null & echo $!; wait $!",
    "without stdin": "{} <&- & echo $!; wait $!",
    "nohup": "nohup {} 2>/dev/null & echo $!; wait $!",
}


@pytest.mark.parametrize("how", STARTS)
def test_an_arm_served_from_a_shell_runs_until_sigterm(tmp_path, how):
    serve = f"{sys.executable} -m experiments fake --idle-first --bare --firmware 60 "
    serve += f"--can traction-fake:{tmp_path}/bus"
    with subprocess.Popen(
        ["bash", "-c", STARTS[how].format(serve)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as shell:
        lines = {shell.stdout.readline(), shell.stdout.readline()}
        (pid,) = [int(line) for line in lines if line.strip().isdigit()]
        with SocketBus(f"{tmp_path}/bus") as bus:
            if how == "nohup":
                os.kill(pid, signal.SIGHUP)  # the terminal was closed
            for _ in range(2):
                assert ask(bus, 10, b"\x00") == (0x546, "80 00 3c 00")  # VERS 60
        os.kill(pid, signal.SIGTERM)
        assert shell.wait(PATIENCE) == 0
    assert not (tmp_path / "bus").exists()


def test_a_script_is_run_although_stdin_has_ended(tmp_path):
    script = tmp_path / "script"
    script.write_text("idle\n0.5 quit\n")
    log = tmp_path / "bus.log"
    done = subprocess.run(
        [
            *(sys.executable, "-m", "experiments", "fake", "--script", script),
            *("--can", f"traction-fake:{tmp_path}/bus", "--can-log", log),
        ],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert " fake0 540#" in log.read_text()  # the safety module reported the change


@pytest.mark.parametrize("where", ["can0", ":can0", "socketcan:"])
def test_a_bus_without_interface_or_channel_is_refused(where):
    done = traction("fake", "--can", where)
    assert done.code == 2
    assert "INTERFACE:CHANNEL" in done.err


def test_a_path_in_use_is_refused(tmp_path):
    with open_socket() as other:
        other.bind(f"{tmp_path}/bus")
        other.listen()
        done = traction("fake", "--can", f"traction-fake:{tmp_path}/bus")
    assert done.code == 2
    assert "in use" in done.err


def test_an_interface_that_does_not_exist_is_a_link_error():
    done = traction("fake", "--can", "nothing:can0")
    assert done.code == 4
    assert "nothing:can0 cannot be opened" in done.err


def test_check_logs_its_bus_and_replay_finds_every_reply(config, tmp_path):
    log = tmp_path / "bus.log"
    options = ("--config", config, "--data", tmp_path)
    assert traction("check", "--fake", "--fast", "--can-log", log, *options).code == 0
    done = traction("replay", "--can", log)
    assert done.code == 0
    assert "host asks puck 7 for IPNM" in done.out
    assert ANSWERS in done.out
    summary = traction("replay", "--can", log, "--summary")
    assert done.out.endswith(summary.out)
    assert "host asks" not in summary.out


def test_a_session_logs_its_cycles(config, tmp_path):
    log = tmp_path / "bus.log"
    done = run_short(config, tmp_path, "TF", 1, "--can-log", log)
    assert done.code == 0
    text = log.read_text()
    assert text.count(" fake0 404#30\n") > 500
    assert text.count(" fake0 402#AA") > 500
    summary = traction("replay", "--can", log, "--summary").out
    assert ANSWERS in summary


def test_a_log_is_never_written_over_a_file(config, tmp_path):
    log = tmp_path / "bus.log"
    log.write_text("precious")
    done = traction("check", "--fake", "--can-log", log, "--config", config)
    assert done.code == 2
    assert "not empty" in done.err
    assert log.read_text() == "precious"


def test_malformed_lines_of_a_log_are_reported(tmp_path):
    log = tmp_path / "bus.log"
    asked = "(1.000000) can0 404#30\n"
    log.write_text(f"\ufeff{asked}\x00\x01nonsense\n(2.12345678) can0 404#30\ncut (16")
    done = traction("replay", "--can", log)
    assert done.code == 6
    assert "Line 2 of the bus log" in done.err
    assert "Line 4 of the bus log" in done.err
    assert done.err.endswith("2 malformed lines were left out.\n")
    assert done.out.count("host asks the arm for P") == 2
    assert "2 frames, 0 of other kinds." in done.out


def test_a_missing_log_is_a_usage_error(tmp_path):
    done = traction("replay", "--can", tmp_path / "none")
    assert done.code == 2
    assert "cannot be read" in done.err


@pytest.mark.parametrize("kind", ["bota", "robotous", "optoforce"])
def test_a_sensor_is_served_to_a_driver_in_another_process(tmp_path, kind):
    path = tmp_path / "sensor"
    command = [sys.executable, "-m", "experiments", "fake", "--serial", str(path)]
    process = subprocess.Popen(
        [*command, "--sensor", kind], stdout=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout.readline() == f"ready: {kind} sensor on {path}\n"
        clock = SystemClock()
        make = MAKES[kind]
        link = SerialLink(open_port(str(path), make.baudrate).port)
        driver = make.device(PortSettings(str(path), make.baudrate, 0.5))
        sensor = SerialSensor(link, clock, driver)
        sensor.open()
        samples, end_ns = [], clock.now_ns() + int(PATIENCE * 1e9)
        while not samples and clock.now_ns() < end_ns:
            clock.wait(sensor, clock.now_ns() + 100_000_000)
            samples = sensor.poll(clock.now_ns())
        newest = samples[-1]
        # the shipped foot of 0.45 kg hangs there; bias and noise 0.4 N rms
        assert newest.wrench[2] == pytest.approx(4.4, abs=2.0)
        sensor.close()
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.communicate()
    assert not path.is_symlink()


def test_a_service_of_nothing_and_a_taken_path_are_refused(tmp_path):
    assert "nothing to serve" in traction("fake").err
    taken = tmp_path / "sensor"
    taken.write_text("")
    done = traction("fake", "--serial", taken)
    assert done.code == 2
    assert "cannot be served" in done.err
    assert taken.read_text() == ""
