"""Sessions killed at random moments are resumed without losing a kept trial."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from acquisition.clock import SystemClock
from experiments.session.crash_recovery import recover_session
from experiments.session.journal import open_journal
from experiments.session.lock import session_lock
from experiments.session.reducer import replay
from experiments.session.states import SessionPhase
from experiments.session.store import list_sessions
from tests.experiments.program import digest, kept_and_sound, run_watched, traction
from tests.experiments.run.test_resume import short

CLOCK = SystemClock()


def run_until(config, data, seconds):
    """Run or resume a session in a child, kill it after `seconds`; its wait status."""
    child = os.fork()
    if child == 0:
        with Path(os.devnull).open("w") as nothing:
            os.dup2(nothing.fileno(), 1)
            os.dup2(nothing.fileno(), 2)
        code = 1
        try:
            code = run_or_resume(config, data)
        finally:
            os._exit(code)
    CLOCK.sleep_until(CLOCK.now_ns() + round(seconds * 1e9))
    os.kill(child, signal.SIGKILL)
    return os.waitpid(child, 0)[1]


def run_or_resume(config, data):
    if list_sessions(data):
        command = ("resume", "--operator-script", "auto", "--data", data)
        return traction(*command).code
    seen = run_watched(config, data, 3, press=lambda asked, _: short(asked))
    return seen.done.code


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_random_kills_lose_no_kept_trial(tmp_path, config):
    assert survive(tmp_path, config, 200, np.random.default_rng(8)) >= 10


def survive(tmp_path, config, count, rng):
    """Kill sessions `count` times; the number of sessions completed in between.

    After each kill the kept trials must be intact and include all earlier ones; a
    session that is not killed must end without an error.
    """
    kills = number = completed = 0
    while kills < count:
        number += 1
        data = tmp_path / str(number)
        safe = {}
        while kills < count:
            status = run_until(config, data, float(rng.uniform(0.2, 5.0)))
            kills += os.WIFSIGNALED(status)
            assert os.waitstatus_to_exitcode(status) in {0, -signal.SIGKILL}
            if not list_sessions(data):
                continue
            (folder,) = list_sessions(data)
            with session_lock(folder):
                recover_session(open_journal(folder, CLOCK))
            state = replay(folder.events())
            kept = [f"T{n:02d}" for n in sorted(state.kept)]
            assert kept == kept_and_sound(folder.path)
            assert [path.stem for path in folder.kept_trials()] == kept
            now = {name: digest(folder.trials / f"{name}.mcap") for name in kept}
            assert now.items() >= safe.items()
            safe = now
            if (
                state.phase in {SessionPhase.COMPLETE, SessionPhase.PLANNED}
                or state.is_complete
            ):
                completed += state.is_complete
                break
        else:  # a slow computer never finished between two kills
            assert run_or_resume(config, data) == 0
            (folder,) = list_sessions(data)
            now = {path.stem: digest(path) for path in folder.kept_trials()}
            assert now.items() >= safe.items()
            completed += replay(folder.events()).is_complete
    return completed
