"""Time, keys, stops and faults of the console loop, without any device."""

import os
import time
from types import SimpleNamespace

import pytest

from acquisition.control_loop.details import CircuitCauses
from acquisition.control_loop.faults import Fault, verdict_for
from acquisition.control_loop.states import ArmState
from acquisition.errors import SessionError
from experiments.operator.prompts import Prompt
from experiments.operator.terminal import TerminalInput
from experiments.run.console_loop import TICK
from experiments.run.stop import ArmFaultError, StopRequestedError
from experiments.session.sidecar import TrialName
from fakes.clock import SteppedClock
from tests.experiments.run.bench import Keys, make_loop, printed_by

NAME = TrialName(3, 2)
STANDING = verdict_for(Fault.CONSOLE_LOST)
MILD = verdict_for(Fault.CONSOLE_SILENT)
WORSE = verdict_for(Fault.E_STOP, CircuitCauses())


def test_a_tick_advances_by_one_period_and_returns_the_key():
    loop = make_loop(Keys("n"))
    assert loop.tick(Prompt.READY, NAME) == "n"
    assert loop.loop_client.advanced == pytest.approx(TICK)


def test_the_operator_sees_trial_attempt_and_age_of_the_prompt():
    operator = Keys()
    loop = make_loop(operator)
    for prompt in (Prompt.LIFT, Prompt.LIFT, Prompt.READY):
        loop.tick(prompt, NAME)
    assert [(s.trial, s.attempt) for s in operator.states] == [(3, 2)] * 3
    assert [s.since for s in operator.states] == pytest.approx([0.0, TICK, 0.0])


@pytest.mark.parametrize("prompt", [Prompt.SUPPORT, Prompt.LIFT, Prompt.RECORDING])
def test_quit_ends_the_session_where_it_has_no_other_meaning(prompt):
    with pytest.raises(StopRequestedError):
        make_loop(Keys("q")).tick(prompt)


@pytest.mark.parametrize("prompt", [Prompt.REVIEW, Prompt.READY])
def test_quit_is_an_ordinary_key_where_it_has_another_meaning(prompt):
    assert make_loop(Keys("q")).tick(prompt) == "q"


def test_a_stop_ends_every_prompt_but_the_review():
    loop = make_loop(Keys("k"))
    loop.stop.request()
    assert loop.tick(Prompt.REVIEW) == "k"
    with pytest.raises(StopRequestedError):
        loop.tick(Prompt.READY)


def test_a_stop_abandons_a_note():
    loop = make_loop(Keys(lines=["half a no"]))
    loop.stop.request()
    assert loop.poll_note(NAME) == ""


def test_a_lost_terminal_is_a_stop():
    loop = make_loop(Keys())
    loop.console.is_lost = True
    with pytest.raises(StopRequestedError):
        loop.tick(Prompt.READY)


@pytest.mark.parametrize("prompt", [Prompt.REVIEW, Prompt.PAUSED])
def test_a_fault_that_persists_is_raised_once_where_the_arm_rests(prompt):
    loop = make_loop(Keys("k"))
    loop.loop_client.status.verdict = STANDING
    with pytest.raises(ArmFaultError):
        loop.tick(prompt)
    assert loop.tick(prompt) == "k"
    loop.loop_client.status.verdict = WORSE
    with pytest.raises(ArmFaultError):
        loop.tick(prompt)


def test_a_fault_that_returns_is_raised_again():
    loop = make_loop(Keys())
    for verdict in (STANDING, STANDING):
        loop.loop_client.status.verdict = verdict
        with pytest.raises(ArmFaultError):
            loop.tick(Prompt.REVIEW)
        loop.loop_client.status.verdict = None
        loop.tick(Prompt.REVIEW)


def test_a_fault_is_raised_at_every_tick_while_recording():
    loop = make_loop(Keys())
    loop.loop_client.status.verdict = STANDING
    for _ in range(2):
        with pytest.raises(ArmFaultError):
            loop.tick(Prompt.RECORDING)


def test_the_worst_verdict_is_the_newest_only_if_it_is_more_severe():
    loop = make_loop(Keys())
    assert loop.worst_verdict(STANDING) is STANDING
    loop.loop_client.status.latch(WORSE)
    assert loop.worst_verdict(STANDING) is WORSE
    loop.loop_client.status.clear()
    loop.loop_client.status.latch(STANDING)
    assert loop.worst_verdict(WORSE) is WORSE


def test_a_fault_followed_by_a_stricter_one_is_reported_once():
    loop = make_loop(Keys())
    loop.loop_client.status.latch(MILD)
    with pytest.raises(ArmFaultError) as raised:
        loop.tick(Prompt.REVIEW)
    assert raised.value.verdict is MILD
    loop.loop_client.status.latch(WORSE)
    words = printed_by(lambda: loop.worst_verdict(MILD))
    assert words.count("No heartbeat from the console for 0.5 s.") == 1
    assert "Stop pressed" not in words
    assert printed_by(lambda: loop.tick(Prompt.REVIEW)) == ""


def test_a_raised_fault_is_noted_as_known():
    loop = make_loop(Keys())
    loop.loop_client.status.latch(MILD)
    assert loop.loop_client.known == 0
    with pytest.raises(ArmFaultError):
        loop.tick(Prompt.READY)
    assert loop.loop_client.known == 1


def test_the_loop_advances_during_background_work():
    loop = make_loop(Keys(), is_stepped=False)

    def work():
        end = time.monotonic() + 5.0  # noqa: TID251 - of a thread that waits for us
        while loop.loop_client.advanced < 3 * TICK and time.monotonic() < end:  # noqa: TID251
            pass
        return "done"

    assert loop.run_in_background(work) == "done"
    assert loop.loop_client.advanced >= 3 * TICK


def test_stepped_time_stands_still_during_background_work():
    loop = make_loop(Keys())
    assert loop.run_in_background(lambda: 7) == 7
    assert loop.loop_client.advanced == 0.0


@pytest.mark.parametrize("is_stepped", [True, False])
def test_an_error_of_background_work_is_raised(is_stepped):
    def work():
        raise SessionError("no")

    with pytest.raises(SessionError):
        make_loop(Keys(), is_stepped=is_stepped).run_in_background(work)


@pytest.fixture
def keyboard():
    """The two ends of the pipe that a person types into."""
    reads, writes = os.pipe()
    yield reads, writes
    os.close(reads)
    os.close(writes)


def waited(loop, prompt, seconds):
    """Let a prompt wait for `seconds`; the seconds that passed in the simulation."""
    before = loop.loop_client.advanced
    for _ in range(round(seconds / TICK)):
        loop.tick(prompt)
    return loop.loop_client.advanced - before


@pytest.mark.parametrize("prompt", [Prompt.SUPPORT, Prompt.READY, Prompt.REVIEW])
def test_the_simulation_pauses_while_a_person_reads(keyboard, prompt):
    wall = SteppedClock()
    loop = make_loop(TerminalInput(keyboard[0]), wall=wall)
    assert waited(loop, prompt, 1.9) == pytest.approx(1.9)
    start_ns, before = wall.now_ns(), loop.loop_client.advanced
    assert waited(loop, prompt, 60.0) < 1.5
    passed = (wall.now_ns() - start_ns) * 1e-9
    assert passed + loop.loop_client.advanced - before == pytest.approx(60.0)


def test_a_key_resumes_a_paused_simulation(keyboard):
    loop = make_loop(TerminalInput(keyboard[0]), wall=SteppedClock())
    waited(loop, Prompt.READY, 60.0)
    os.write(keyboard[1], b"n")
    assert loop.tick(Prompt.READY) == "n"
    assert waited(loop, Prompt.READY, 1.9) == pytest.approx(1.9)


def test_the_simulation_does_not_pause_while_the_hand_moves(keyboard):
    loop = make_loop(TerminalInput(keyboard[0]), wall=SteppedClock())
    loop.rig.simulation = SimpleNamespace(is_hand_done=False)
    assert waited(loop, Prompt.TOUCH, 60.0) == pytest.approx(60.0)
    loop.rig.simulation.is_hand_done = True
    assert waited(loop, Prompt.TOUCH, 60.0) < 4.0


@pytest.mark.parametrize(
    "prompt", [Prompt.RECORDING, Prompt.MOVING, Prompt.LIFT, Prompt.UNDO]
)
def test_the_simulation_does_not_pause_at_prompts_with_motion(keyboard, prompt):
    loop = make_loop(TerminalInput(keyboard[0]), wall=SteppedClock())
    assert waited(loop, prompt, 60.0) == pytest.approx(60.0)


def test_the_simulation_does_not_pause_without_a_person():
    loop = make_loop(Keys(), wall=SteppedClock())
    assert waited(loop, Prompt.READY, 60.0) == pytest.approx(60.0)


def test_a_note_is_shown_as_typed_in_a_paused_simulation(keyboard):
    shown = []
    console = SimpleNamespace(is_live=True, is_lost=False, width=80, panel=shown.append)
    loop = make_loop(TerminalInput(keyboard[0]), wall=SteppedClock(), console=console)
    console.end_panel = lambda: None
    loop.show(lambda _: [loop.operator.draft])
    for _ in range(500):
        loop.poll_note(NAME)
    shown.clear()
    os.write(keyboard[1], b"wet")
    for _ in range(10):
        assert loop.poll_note(NAME) is None
    assert shown[-1] == ["wet"]


def test_a_stop_holds_the_arm():
    loop = make_loop(Keys())
    loop.stop.request()
    loop.stop_arm()
    assert loop.loop_client.requested == [ArmState.HOLD]


def test_an_urgent_stop_damps_and_brakes_once():
    loop = make_loop(Keys())
    loop.stop.request()
    loop.stop.request()
    loop.stop_arm()
    loop.stop_arm()
    assert loop.loop_client.requested == [ArmState.DAMP, ArmState.IDLE]
