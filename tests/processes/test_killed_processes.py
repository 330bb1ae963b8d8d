"""A killed process of a trial leaves the arm safe and most of the recording."""

import contextlib

import numpy as np
import pytest
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader

from acquisition.clock import NS_PER_S
from acquisition.control_loop.states import ArmState
from acquisition.devices import SafetyMode
from acquisition.schema import CYCLE
from tests.processes.watching import (
    is_running,
    judged,
    session,
    until,
    wait,
)

pytestmark = [pytest.mark.wall_clock, pytest.mark.timeout(400)]
SAFE = {ArmState.HOLD, ArmState.DAMP, ArmState.IDLE}
REACTION = 0.6  # s
LOSS = 0.5  # s of the running trial
LONGEST_CYCLE_NS = 20_000_000  # beyond it the machine stalled, and the arm with it
VICTIMS = ("recorder", "console", "sensor reader", "control")


def moments(count):
    rng = np.random.default_rng(20)
    return [(v, float(s)) for v in VICTIMS for s in rng.uniform(0.3, 6.0, count)]


def is_safe(seen):
    """Whether the arm holds or is braked, as reported by the loop or the pucks."""
    if is_running(seen.pids["control"]):
        return seen.status().control.state in SAFE
    return seen.pucks_mode() in {SafetyMode.IDLE, SafetyMode.E_STOP}


def last_cycle_ns(seen):
    """Time of the last cycle that can be read [monotonic ns]."""
    (folder,) = seen.data.glob("sessions/*.fake")
    whole = [*folder.glob("trials/T*.mcap"), *folder.glob("rejected/T*.mcap")]
    whole = [path for path in whole if "truth" not in path.name]
    # If a stall ended a trial that was then repeated, the last attempt counts.
    path = max(whole or folder.glob("trials/*.partial"), key=lambda path: path.stem)
    last = None
    with path.open("rb") as stream, contextlib.suppress(McapError):
        reader = NonSeekingReader(stream)
        for _, _, message in reader.iter_messages("/cycle", log_time_order=False):
            last = message.data
    return int(np.frombuffer(last, CYCLE.dtype)["host_ns"][0])


@pytest.mark.parametrize(("victim", "after"), moments(1))
def test_a_killed_process_loses_little_of_the_recording(tmp_path, victim, after):
    assert seconds_lost(tmp_path, victim, after) <= LOSS


@pytest.mark.long
@pytest.mark.parametrize(("victim", "after"), moments(20))
def test_many_kills_of_each_process_lose_little_of_the_recording(
    tmp_path, victim, after
):
    assert seconds_lost(tmp_path, victim, after) <= LOSS


def seconds_lost(tmp_path, victim, after):
    """Kill a process of a trial and check that the arm stops; the seconds lost.

    On a machine that stalls, the guard may have ended the trial before the kill; then
    the session is repeated.
    """
    return judged(tmp_path, lambda data: seconds_lost_once(data, victim, after))


def seconds_lost_once(data, victim, after):
    """Lost end of the recording [s]; None if the trial had ended before the kill."""
    with session(data) as seen:
        if not seen.wait_for_trial():
            return None
        wait(after)
        newest_ns = seen.newest_cycle_ns()
        if seen.has_trial_ended():
            return None
        killed_ns = min(seen.kill(victim), newest_ns + LONGEST_CYCLE_NS)
        assert until(lambda: is_safe(seen), REACTION) is not None, seen.output()
        assert until(lambda: not is_running(seen.process.pid), 30)
        if victim != "console":
            assert seen.process.wait(1) == 4, seen.output()
            assert f"{victim} process ended" in seen.output()
        gone = until(lambda: not any(is_running(pid) for pid in seen.pids.values()), 10)
        assert gone, "a process was left behind"
    return (killed_ns - last_cycle_ns(seen)) / NS_PER_S
