"""A fault that persists while the arm is not needed is reported once."""

from dataclasses import replace

import pytest

from acquisition.control_loop.states import ArmState
from experiments.operator.prompts import Prompt
from experiments.session.reducer import replay
from tests.experiments.built import watch_builds
from tests.experiments.program import journal, run_watched

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]
MANY = 40  # looks of 20 ms; each clearing of the fault takes 5 or more of them


def narrow(cycle):
    """Narrow the upper limit of joint 6 so that the joint is beyond it."""
    upper = (*cycle.limits.q_upper[:5], -1.5, cycle.limits.q_upper[6])
    cycle.limits = replace(cycle.limits, q_upper=upper)


@pytest.fixture
def built(monkeypatch):
    """The parts of a session that are built during the test."""
    return watch_builds(monkeypatch)


@pytest.mark.parametrize("prompt", [Prompt.REVIEW, Prompt.PAUSED])
def test_keys_are_read_while_a_fault_persists(config, tmp_path, built, prompt):
    looks, states = [], set()

    def press(asked, _):
        if asked.prompt is prompt or (looks and asked.prompt is Prompt.DAMPED):
            looks.append(asked)
            states.add(built.backend.loop_client.status.state)
            if len(looks) == 1:
                narrow(built.cycle)
            if asked.prompt is Prompt.DAMPED:
                return " " if len(looks) > MANY else ""
            return "q" if len(looks) > MANY else ""
        if asked.prompt is Prompt.READY and asked.since < 2.0:
            return ""  # the foot is led to the start
        if asked.prompt is Prompt.READY:
            return "p" if prompt is Prompt.PAUSED else " "
        if asked.prompt is Prompt.RECORDING:
            return " " if asked.since > 0.5 else ""
        return None

    seen = run_watched(config, tmp_path, 1, press=press)
    assert MANY < len(looks) < MANY + 5
    assert states <= {ArmState.HOLD, ArmState.DAMP}
    assert seen.done.err.count("Joint 6 at ") == 1
    assert (seen.done.code, replay(journal(seen.folder)).phase) == (5, "unfinished")
