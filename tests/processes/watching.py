"""Observation of a session in processes: its processes and the state of the arm."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from acquisition.clock import NS_PER_S, SystemClock
from acquisition.devices import SafetyMode
from acquisition.ipc.commands import StatusSlot
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.shared_memory import SharedMemory
from fakes.bus.client import SocketBus
from tests.experiments.program import changed, write_config
from tests.stalls import stall_witness

ROOT = Path(__file__).parents[2]
CLOCK = SystemClock()
TRIES = 5  # of sessions on a machine that stalls
NAMES = {
    "control": "traction-contro",  # the kernel keeps 15 characters
    "recorder": "traction-record",
    "sensor reader": "traction-reader",
    "fake rig": "traction-fake",
}
STALLED = re.compile(
    "late cycles in|No reply from the arm|not answered for|F/T sample [0-9]+ ms"
    "|does not answer GET"  # before the loop: the simulated devices stalled
)
MEASURED = re.compile(r"missed (\d+)/(\d+)")  # the loop as measured by the preflight
MAX_MISSED = 0.05  # share of cycles beyond which any limit of the guard may be reached
START = "import sys; from experiments.__main__ import main; sys.exit(main())"


def wait(seconds):
    CLOCK.sleep_until(CLOCK.now_ns() + int(seconds * NS_PER_S))


def until(condition, seconds):
    """Wait until `condition()` is true; return its value, None after `seconds`."""
    end_ns = CLOCK.now_ns() + int(seconds * NS_PER_S)
    while CLOCK.now_ns() < end_ns:
        if value := condition():
            return value
        wait(0.01)
    return None


def children_of(pid):
    """{short name: pid} of the living children of `pid`."""
    children = {}
    for task in Path("/proc").glob("[0-9]*"):
        try:
            fields = (task / "stat").read_text()
        except OSError:
            continue
        name = fields[fields.index("(") + 1 : fields.rindex(")")]
        state, parent = fields[fields.rindex(")") + 2 :].split()[:2]
        if int(parent) == pid and state != "Z":
            children[name] = int(task.name)
    return children


def is_running(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in {"Z", "X"}


def is_stalled(text):
    """Whether the output of a session is that of a stalled machine."""
    measured = MEASURED.search(text)
    missed, cycles = map(int, measured.groups()) if measured else (0, 1)
    return STALLED.search(text) is not None or missed > MAX_MISSED * cycles


class Session:
    """A `traction run --fake` in a separate process."""

    def __init__(self, process, data):
        self.process = process
        self.data = data
        self.pids = {}
        self.shared = None

    def wait_for_trial(self):
        """Wait for the recording of a trial; False if the machine is too slow."""
        if not self.arrives(self._is_recording, 40):
            assert self.has_stalled(), self.output()
            return False
        children = children_of(self.process.pid)
        self.pids = {name: children[short] for name, short in NAMES.items()}
        self.attach()
        return True

    def arrives(self, is_there, seconds):
        """Wait until `is_there()` is true, only briefly if the machine stalled."""
        if until(lambda: is_there() or self.has_stalled(), seconds) and is_there():
            return True
        return until(is_there, 5) is not None

    def attach(self):
        """Open the memory that the processes share."""
        self.shared = SharedLayout(SharedMemory(self._open_memory()))

    def has_stalled(self):
        """Whether the arm was stopped because the machine stalled.

        Either the message says so, or the preflight had measured a loop that misses so
        many cycles that joint 7, whose lock is stiff, shakes.
        """
        return is_stalled(self.output())

    def journal(self):
        paths = list(self.data.glob("sessions/*/events.jsonl"))
        if not paths:
            return []
        return [json.loads(line) for line in paths[0].read_text().splitlines()]

    def status(self):
        return StatusSlot(self.shared.status).read()

    def pucks_mode(self):
        """Ask the simulated safety module for its mode, as another host on the bus."""
        pid = self.pids["fake rig"]
        (path,) = Path(tempfile.gettempdir()).glob(f"traction-{pid}-*/can")
        with SocketBus(str(path)) as bus:
            bus.send(
                can.Message(arbitration_id=0x00A, is_extended_id=False, data=b"\x08")
            )
            while (message := bus.recv(0.2)) is not None:
                if message.arbitration_id == 0x546 and message.data[0] == 0x88:
                    return SafetyMode(message.data[2])
        return None

    def output(self):
        return (self.data / "out.txt").read_text()

    def newest_cycle_ns(self):
        """Time of the newest cycle in memory [monotonic ns]."""
        return int(self.shared.cycles.last(1)["host_ns"][0])

    def has_trial_ended(self):
        """Whether the journal has an event after the start of the trial."""
        return self.journal()[-1]["event"] != "trial-started"

    def kill(self, name):
        """Kill the process `name`; the time of the kill [monotonic ns]."""
        pid = self.process.pid if name == "console" else self.pids[name]
        os.kill(pid, signal.SIGKILL)
        return CLOCK.now_ns()

    def _is_recording(self):
        return any(entry["event"] == "trial-started" for entry in self.journal())

    def _open_memory(self):
        """Open the memory through the process that has the arm."""
        folder = Path(f"/proc/{self.pids['control']}/fd")
        for descriptor in folder.iterdir():
            if descriptor.readlink().name.startswith("memfd:traction ") or str(
                descriptor.readlink()
            ).startswith("/memfd:traction ("):
                return os.open(descriptor, os.O_RDWR)
        raise AssertionError("the shared memory was not found")


def patient_config(folder, **options):
    """Write a configuration for a busy machine; the path of its rig.toml.

    Its loop tolerates late cycles, whose limit is tested in stepped time, and is
    measured for one second only before the session. Options: see `write_config`.
    """
    path = write_config(folder, **options)
    text = changed(path.read_text(), "late_per_second = 10 ", "late_per_second = 500 ")
    path.write_text(changed(text, "test_time = 5.0 ", "test_time = 1.0 "))
    return path


def not_judged(tries):
    """Skip a test whose sessions were all ended by stalls of the machine."""
    pytest.skip(f"not judged: the machine stood still in each of {tries} sessions")


def judged(folder, attempt, tries=TRIES):
    """Result of `attempt(folder of its own)` on a machine that may stall.

    An attempt that a stall has ended returns None and is repeated. If the witness saw
    no stall meanwhile, the test fails.
    """
    with stall_witness(folder) as witness:
        for number in range(tries):
            start_ns = CLOCK.now_ns()
            result = attempt(folder / f"try{number}")
            if result is not None:
                return result
            assert witness.stalls_since(start_ns), "the machine did not stall"
    return not_judged(tries)


@contextmanager
def session(data, *options):
    """Start a session; kill what is left of its processes at the end."""
    data.mkdir(parents=True, exist_ok=True)
    config = patient_config(data)
    command = [sys.executable, "-c", START, "run", "S0", "--fake", "--processes"]
    command += ["--trials", "1"]
    command += ["--operator-script", "auto", "--config", str(config)]
    command += ["--data", str(data), *options]
    with (data / "out.txt").open("w") as out:
        process = subprocess.Popen(
            command, cwd=ROOT, stdout=out, stderr=out, stdin=subprocess.DEVNULL
        )
    seen = Session(process, data)
    try:
        yield seen
    finally:
        left = [process.pid, *seen.pids.values()]
        for pid in left:
            if is_running(pid):
                os.kill(pid, signal.SIGKILL)
        process.wait(10)


@contextmanager
def running_trial(folder, tries=TRIES):
    """A session in the second second of its trial.

    If a stall that the witness saw has ended the trial or kept it from beginning,
    another session is started.
    """
    with stall_witness(folder) as witness:
        for number in range(tries):
            start_ns = CLOCK.now_ns()
            with session(folder / f"data{number}") as seen:
                if seen.wait_for_trial():
                    wait(1.0)
                    if not seen.has_trial_ended():
                        yield seen
                        return
            assert witness.stalls_since(start_ns), seen.output()
    not_judged(tries)
