"""Faults of processes, signals and the disk in every phase, on the wall clock."""

import contextlib
import os
import pty
import select
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from acquisition.control_loop.states import ArmState
from acquisition.devices import SafetyMode
from tests.attacks.attack import Attack, RunBy
from tests.experiments.program import traction
from tests.faults.expected import Cell, End
from tests.faults.phases import PHASES
from tests.faults.processes import TABLE
from tests.processes.watching import (
    NAMES,
    ROOT,
    Session,
    children_of,
    is_running,
    judged,
    patient_config,
    until,
    wait,
)

TRIES = 5  # a session may stop because the machine stalled
REACTION = 0.6  # s, from the fault until the arm holds or is idle
SAFE = {ArmState.HOLD, ArmState.DAMP, ArmState.IDLE}
BRAKED = {SafetyMode.IDLE, SafetyMode.E_STOP}
CODES = {
    End.STOPPED: {5},
    End.ENDED: {4},
    End.LOST_EARLY: {3, 4},
    End.COMPLETE: {0},
    End.UNBRACKETED: {0},
    End.INTERRUPTED: {130},
    End.KILLED: {-signal.SIGKILL, -signal.SIGTERM, -signal.SIGHUP},
}
# For each commit; tests/processes covers a killed console, too.
DAILY = {
    ("recorder killed", "ready"),
    ("sensor reader killed", "tare"),
    ("SIGINT", "preflight"),
    ("SIGTERM", "recording"),
    ("terminal closed", "idle"),
    ("fsync of 200 ms", "idle"),
}

# The program, with an operator that waits at one prompt until the fault has occurred.
START = """
import fcntl, sys, termios
if sys.stdout.isatty():
    fcntl.ioctl(1, termios.TIOCSCTTY, 0)
from pathlib import Path
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.prompts import Prompt
from experiments.rig.simulation import SimulatedHand
prompt, marker = sys.argv.pop(1), Path(sys.argv.pop(1))
answer, follow = AutoOperator.answer, SimulatedHand.follow
def waiting(keys, asked):
    is_last = prompt == "end" and asked.prompt is Prompt.LIFT and asked.trial == 0
    if asked.prompt.value == prompt or is_last:
        marker.touch()
        if not marker.with_suffix(".over").exists():
            return ""
    return answer(keys, asked)
def idle(hand, asked):
    is_held = prompt == "support" and asked.prompt.value == prompt
    if not is_held or marker.with_suffix(".over").exists():
        follow(hand, asked)
AutoOperator.answer, SimulatedHand.follow = waiting, idle
from experiments.__main__ import main
sys.exit(main())
"""
SLOW_DISK = """
import os, sys
fsync = os.fsync
def slow(descriptor):
    __import__("select").select([], [], [], 0.2)
    fsync(descriptor)
os.fsync = slow
"""
PROMPTS = {
    "preflight": "none",
    "idle": "support",
    "tare": "lift",
    "ready": "ready",
    "recording": "recording",
    "review": "review",
    "end": "end",
}


@dataclass
class SimulatedScene:
    """A session that waits in a phase."""

    seen: Session
    terminal: int
    marker: object

    is_closing: bool = False

    def read_terminal(self):
        """Read the output, since the program blocks on a full terminal."""
        with contextlib.suppress(OSError):
            while not self.is_closing:
                if select.select([self.terminal], [], [], 0.05)[0]:
                    os.read(self.terminal, 4096)

    def close_terminal(self):
        """Close the terminal; a second call does nothing."""
        if not self.is_closing:
            self.is_closing = True
            wait(0.1)  # the reader has stopped
            os.close(self.terminal)

    def go_on(self):
        self.marker.with_suffix(".over").touch()


@contextmanager
def waiting_in(phase, folder, fault):
    """Start a session that waits in `phase`; end its processes afterwards."""
    data = folder / "data"
    data.mkdir()
    marker = folder / "there"
    config = patient_config(folder, travel=0.12)
    command = [sys.executable, "-c", START, PROMPTS[phase], str(marker), "run", "TF"]
    command += ["--fake", "--processes", "--trials", "1", "--operator-script", "auto"]
    command += ["--config", str(config), "--data", str(data)]
    environment = dict(os.environ)
    if fault.startswith("fsync"):
        (folder / "sitecustomize.py").write_text(SLOW_DISK)
        environment["PYTHONPATH"] = str(folder)
    ours, theirs = pty.openpty()
    with (data / "out.txt").open("w") as out:
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            stdout=theirs if fault == "terminal closed" else out,
            stderr=out,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
            env=environment,
        )
    os.close(theirs)
    seen = Session(process, data)
    scene = SimulatedScene(seen, ours, marker)
    threading.Thread(target=scene.read_terminal, daemon=True).start()
    try:
        yield scene
    finally:
        for pid in [process.pid, *seen.pids.values()]:
            if is_running(pid):
                os.kill(pid, signal.SIGKILL)
        process.wait(10)
        scene.close_terminal()


def codes_of(fault, cell):
    """Return the allowed exit codes; the second SIGINT may arrive after the end."""
    return CODES[cell.end] | ({130} if fault == "SIGINT twice" else set())


def arrive(scene, phase):
    """Wait for the session in `phase`; return False if the machine is too slow."""
    seen = scene.seen

    def is_there():
        if phase == "preflight":
            return set(NAMES.values()) <= set(children_of(seen.process.pid))
        return scene.marker.exists()

    if not seen.arrives(is_there, 60):
        assert seen.has_stalled(), seen.output()
        return False
    children = children_of(seen.process.pid)
    seen.pids = {name: children[short] for name, short in NAMES.items()}
    wait(0.5)  # well inside the phase
    if phase != "preflight":
        seen.attach()
    return True


def inject(scene, fault):
    """Cause `fault`."""
    seen, console = scene.seen, scene.seen.process.pid
    if fault.endswith(" killed"):
        seen.kill(fault.removesuffix(" killed"))
    elif fault == "SIGINT twice":
        os.kill(console, signal.SIGINT)
        wait(0.1)
        os.kill(console, signal.SIGINT)
    elif fault == "terminal closed":
        scene.close_terminal()
    elif fault.startswith("SIG"):
        os.kill(console, signal.Signals[fault])


def is_safe(seen):
    if seen.shared is None:
        return True  # the arm is not in use yet
    if is_running(seen.pids["control"]) and seen.status().is_running:
        return seen.status().control.state in SAFE
    if not is_running(seen.pids["fake rig"]):
        return True  # the rig ends last, when the arm is idle
    return seen.pucks_mode() in BRAKED


def process_attacks() -> list[Attack]:
    """Return every process fault in every phase."""
    return [
        _attack(fault, phase, cell)
        for fault, row in TABLE.items()
        for phase, cell in zip(PHASES, row, strict=True)
    ]


def _attack(fault: str, phase: str, cell: Cell) -> Attack:
    def survived(folder: Path) -> bool | None:
        return is_survived(folder, fault, phase, cell) or None

    def check(folder: Path) -> None:
        assert judged(folder, survived, TRIES)

    return Attack(
        fault,
        phase,
        f"{cell.end.value}; arm holding or idle within {REACTION} s",
        check,
        RunBy.CI if (fault, phase) in DAILY else RunBy.NIGHTLY,
        seconds=400,
        on_wall_clock=True,
    )


def is_survived(folder, fault, phase, cell):
    """Check one session against the table; return False if it stalled first."""
    folder.mkdir()
    with waiting_in(phase, folder, fault) as scene:
        seen = scene.seen
        if not arrive(scene, phase):
            return False
        inject(scene, fault)
        if cell.end is not End.COMPLETE:
            assert until(lambda: is_safe(seen), REACTION) is not None, seen.output()
        if cell.end is End.COMPLETE:
            scene.go_on()
        assert until(lambda: not is_running(seen.process.pid), 60), seen.output()
        code = seen.process.wait(1)
        if code not in codes_of(fault, cell) and seen.has_stalled():
            return False
        assert code in codes_of(fault, cell), seen.output()
        assert "Traceback" not in seen.output()
        assert cell.text in seen.output()
        gone = until(lambda: not any(is_running(p) for p in seen.pids.values()), 10)
        assert gone, "a process was left behind"
    check_resume(seen.data, cell)
    return True


def check_resume(data, cell):
    """Check that an interrupted session is completed and leaves no partial trial."""
    if not (data / "sessions").exists():
        return
    done = traction("resume", "--fast", "--operator-script", "auto", "--data", data)
    nothing = done.err.startswith("There is no unfinished session")
    assert done.code == 0 or nothing, done.err
    assert not list(data.rglob("trials/*.partial"))
