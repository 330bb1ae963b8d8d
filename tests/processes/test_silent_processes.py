"""A process of a running trial stops for a while; the arm does not wait for it."""

import os
import signal

import pytest

from acquisition.control_loop.states import ArmState
from tests.processes.watching import running_trial, until

pytestmark = pytest.mark.wall_clock
LIMIT = 0.5  # s, of a heartbeat
REACTION = 0.6  # s


def holds(seen):
    return seen.status().control.state is ArmState.HOLD


@pytest.mark.parametrize(
    ("victim", "message"),
    [
        ("console", "The console did not look after the arm for 0.5 s. ARM: holding."),
        ("recorder", "the recorder was silent for 0.5 s. Is the disk slow? ARM: hold"),
    ],
)
def test_a_process_that_stops_for_a_while_ends_the_trial_only(
    tmp_path, victim, message
):
    with running_trial(tmp_path) as seen:
        pid = seen.process.pid if victim == "console" else seen.pids[victim]
        os.kill(pid, signal.SIGSTOP)
        try:
            held = until(lambda: holds(seen), LIMIT + REACTION)
        finally:
            os.kill(pid, signal.SIGCONT)
        assert held
        assert until(lambda: message in seen.output(), 5), seen.output()
        ends = [e["event"] for e in seen.journal()]
        assert "session-ended" not in ends
        assert until(lambda: "T01 kept as interrupted" in seen.output(), 10)


def test_ctrl_c_ends_a_session_with_everything_put_away(tmp_path):
    with running_trial(tmp_path) as seen:
        seen.process.send_signal(signal.SIGINT)
        assert seen.process.wait(15) == 5, seen.output()
        assert "ARM: idle, braked." in seen.output()
        assert not list(tmp_path.rglob("*.partial"))
