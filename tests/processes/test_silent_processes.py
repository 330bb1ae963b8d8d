"""A process that stops for a while during a trial does not endanger the arm."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from mcap.reader import make_reader

from acquisition.control_loop.states import ArmState
from acquisition.schema import TRUTH
from tests.processes.watching import (
    is_running,
    judged,
    running_trial,
    session,
    until,
    wait,
)

pytestmark = [pytest.mark.wall_clock, pytest.mark.timeout(400)]
LIMIT = 0.5  # s, of a heartbeat
REACTION = 0.6  # s
STEP = 10  # samples, over which a true speed is taken
# rad/s; the guard's limits of joints 1 and 2, and less than its limits of the others
FASTEST = np.array([1.5, 1.5, 2.0, 2.0, 2.0, 2.0, 2.0])
HOG = (
    "import os, sys, time; os.sched_setaffinity(0, {int(sys.argv[1])});"
    "os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(90));"
    "end = time.monotonic() + float(sys.argv[2])\n"
    "while time.monotonic() < end: pass"
)
# Everything that can stall alongside a running arm, and for how long [s].
STOPS = [
    (victim, seconds)
    for victim in ("console", "recorder", "sensor reader", "control", "every core")
    for seconds in (0.05, 0.3, 1.0)
]
SHORT = {("control", 0.3), ("every core", 0.3)}


def holds(seen):
    return seen.status().control.state is ArmState.HOLD


@pytest.mark.parametrize(
    ("victim", "message"),
    [
        ("console", "No heartbeat from the console for 0.5 s. ARM: holding."),
        (
            "recorder",
            "no heartbeat from the recorder for 0.5 s. Is the disk slow? ARM: hold",
        ),
    ],
)
def test_a_process_that_stops_for_a_while_ends_the_trial_only(
    tmp_path, victim, message
):
    assert judged(tmp_path, lambda data: is_ended_with(data, victim, message))


def is_ended_with(data, victim, message):
    """Whether a trial ends as expected; None if it ended otherwise before.

    On a machine that stalls, the guard ends the trial for the stall.
    """
    with session(data) as seen:
        if not seen.wait_for_trial():
            return None
        wait(1.0)
        if seen.has_trial_ended():
            return None
        pid = seen.process.pid if victim == "console" else seen.pids[victim]
        os.kill(pid, signal.SIGSTOP)
        try:
            held = until(lambda: holds(seen), LIMIT + REACTION)
        finally:
            os.kill(pid, signal.SIGCONT)
        is_reported = until(lambda: message in seen.output(), 5)
        if seen.has_stalled():
            return None
        assert held
        assert is_reported, seen.output()
        ends = [e["event"] for e in seen.journal()]
        assert "session-ended" not in ends
        return (
            until(lambda: "T01 saved as interrupted" in seen.output(), 10) is not None
        )


def test_ctrl_c_ends_a_session_without_partial_files(tmp_path):
    with running_trial(tmp_path) as seen:
        seen.process.send_signal(signal.SIGINT)
        assert seen.process.wait(15) == 5, seen.output()
        assert "ARM: idle; it sinks slowly, support it." in seen.output()
        assert not list(tmp_path.rglob("*.partial"))


def stop(seen, victim, seconds):
    """Stall a process, or every other program on the machine."""
    if victim == "every core":
        hogs = [
            subprocess.Popen([sys.executable, "-c", HOG, str(core), str(seconds)])
            for core in os.sched_getaffinity(0)
        ]
        assert [hog.wait(20) for hog in hogs] == [0] * len(hogs)
        return
    pid = seen.process.pid if victim == "console" else seen.pids[victim]
    os.kill(pid, signal.SIGSTOP)
    wait(seconds)
    os.kill(pid, signal.SIGCONT)


def true_speeds(data):
    """Largest true speed of each joint in every trial [rad/s]."""
    paths = list(data.glob("sessions/*/*/T*.truth.mcap"))
    assert paths, "no truth was recorded"
    return [fastest(path) for path in paths]


def fastest(path):
    with path.open("rb") as stream:
        messages = make_reader(stream).iter_messages("/truth")
        data = b"".join(message.data for _, _, message in messages)
    records = np.frombuffer(data, TRUTH.dtype)
    seconds = np.diff(records["host_ns"][::STEP].astype(np.int64)) * 1e-9
    moved = np.diff(records["position"][::STEP], axis=0)
    return np.abs(moved / seconds[:, None]).max(axis=0)


@pytest.mark.parametrize(
    ("victim", "seconds"),
    [
        pytest.param(*case, marks=[] if case in SHORT else pytest.mark.long)
        for case in STOPS
    ],
)
def test_the_arm_does_not_exceed_its_speed_whatever_stalls(tmp_path, victim, seconds):
    with running_trial(tmp_path) as seen:
        stop(seen, victim, seconds)
        assert until(seen.has_trial_ended, 60), seen.output()
        seen.process.send_signal(signal.SIGINT)
        assert until(lambda: not is_running(seen.process.pid), 30)
        assert "Traceback" not in seen.output()
        assert "ARM: idle; it sinks slowly, support it." in seen.output()
        for speeds in true_speeds(seen.data):
            assert (speeds < FASTEST).all()


@pytest.mark.parametrize(
    ("victim", "fault"),
    [
        ("recorder", "o heartbeat from the recorder"),
        ("sensor reader", "F/T sample"),
    ],
)
def test_a_process_that_never_answers_again_ends_the_session(tmp_path, victim, fault):
    """As one that waits for a broken device: the arm holds, then goes idle."""
    with running_trial(tmp_path) as seen:
        os.kill(seen.pids[victim], signal.SIGSTOP)
        assert until(lambda: holds(seen), LIMIT + REACTION)
        assert until(lambda: fault in seen.output(), 5) is not None, seen.output()
        assert until(lambda: not is_running(seen.process.pid), 90), seen.output()
        assert seen.process.wait(1) == 4
        assert f"{victim} process ended: killed after 20 s" in seen.output()
        assert "ARM: idle; it sinks slowly, support it." in seen.output()
        assert "Traceback" not in seen.output()
