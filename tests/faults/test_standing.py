"""Faults while the arm stands by itself: its foot pressed on the ground in a stance.

A stance is a recording; a fault comes to what the matrix says of one, and the true arm
keeps the same promises. Some come to something else: nobody holds the foot, the arm
presses it, and a contact is judged as that of an arm that moves by itself.
"""

import numpy as np
import pytest

from acquisition.control_loop.states import ArmState
from tests.experiments.program import write_config
from tests.faults.expected import NOTHING, TABLE, End
from tests.faults.phases import PHASES, STANDING
from tests.faults.rehearse import resume, run_with
from tests.faults.strikes import strike_of
from tests.faults.test_matrix import check_arm, check_files, check_resume, check_words
from tests.faults.truth import Promise, is_within, promise_of

pytestmark = pytest.mark.timeout(240)
_RECORDING = PHASES.index("recording")
_DAILY = "can-silence"
FAULTS = (
    "reply-lost",
    "reply-lost-3",
    "reply-lost-10",
    "reply-lost-some",
    "reply-late",
    "reply-doubled",
    "reply-swapped",
    "reply-spoilt",
    "puck-silent",
    "puck-reboot",
    "puck-hot",
    "puck-error",
    "can-silence",
    "bus-off",
    "interface-down",
    "unacknowledged",
    "bus-flooded",
    "bus-shared",
    "estop",
    "pendant-idle",
    "safety-heartbeat",
    "safety-speed",
    "safety-torque",
    "safety-voltage",
    "position-jump",
    "safety-silent",
    "safety-disobedient",
    "lie-of-motor-1",
    "lie-of-motor-2",
    "lie-of-motor-3",
    "lie-of-motor-4",
    "lie-of-motor-5",
    "lie-of-motor-6",
    "stuck-motor-1",
    "stuck-motor-4",
    "stuck-motor-7",
    "ft-stale",
    "ft-frozen",
    "ft-garbled",
    "ft-saturated",
    "ft-not-a-number",
    "ft-unplugged",
    "ft-jump",
    "ft-reboot",
    "ft-clock-jump",
    "early-activation",
    "not-a-number",
    "joint-limit",
    "torque-limit",
    "joint7-slip",
    "stall-3-ms",
    "stall-20-ms",
    "stall-150-ms",
    "stall-150-ms, heartbeat 1 s",
    "can-silence, heartbeat 1 s",
    "clock-step",
    "second-command",
    "disk-full",
    "disk-read-only",
    NOTHING,
    "hand-gone",
    "safety-false-idle",
    *(f"dead-motor-{motor}" for motor in range(1, 8)),
)
PRESSED = Promise(
    speed=5.0,
    drive=150.0,
    hand=np.inf,
    why="a position that lies drives a pressed foot against the ground until the guard "
    "sees it, and joint 7 is light; nobody holds the foot, a real arm refuses to "
    "stand, and the hand comes when the arm is idle",
)
# Reasons of which one ends the stance.
STOPPED = {
    "lie-of-motor-7": {"torque-limit"},
    "contact-force": {"contact-move"},
    "foot-speed": {"foot-speed", "overspeed"},
    "overspeed": {"overspeed"},
    **{
        f"creep-of-motor-{motor}": {
            *("overspeed", "foot-speed", "torque-limit", "contact-move"),
            "kinetic-energy",
        }
        for motor in range(1, 8)
    },
}
STOPS = {"contact-move": ("driven", ArmState.HOLD), "kinetic-energy": ("idle", None)}
# What ends the session, and the reason with which the stance is put away.
ENDED = {
    "replies-late": "replies-late",
    "replies-late-2": "replies-late",
    "replies-late-3": "replies-late",
    "puck-late": "replies-late",
    "hold-dragged": "pendant-idle",  # the module sees how fast the person is
}
LATER = ("puck-changed",)  # asked for in turn, found after the stance
ABSENT = tuple(f for f, row in TABLE.items() if row[_RECORDING].end is End.ABSENT)
SLOWEST_MS = 1000  # a creeping encoder takes as long to be seen
UNSEEN = tuple(f"stuck-motor-{motor}" for motor in (2, 3, 5, 6))
MOST_TRAVEL = 0.001  # m of a sole that stands


def strike(tmp_path, fault):
    """Return what a session of stances comes to when `fault` strikes in the first."""
    config = write_config(tmp_path)
    seen = run_with(strike_of(fault), STANDING, config, tmp_path / "data")
    assert seen.scene.strikes == 1
    return seen


def marked():
    """Return every fault as a parameter; all but one are run by hand."""
    marks = {_DAILY: [pytest.mark.slow]}
    return [
        pytest.param(fault, marks=marks.get(fault, [pytest.mark.long]))
        for fault in FAULTS
    ]


@pytest.mark.parametrize("fault", marked())
def test_a_fault_in_a_stance_comes_to_what_it_does_in_a_trial(tmp_path, fault):
    cell = TABLE[fault][_RECORDING]
    seen = strike(tmp_path, fault)

    check_words(seen, cell)
    check_arm(seen, cell)
    motion = seen.truth.since(seen.scene.struck_ns, fault)
    assert is_within(motion, promise_of(fault, cell)), motion
    check_files(seen, cell)
    check_resume(seen, cell)


def test_every_fault_has_its_place():
    places = [*FAULTS, *STOPPED, *ENDED, *UNSEEN, *LATER, *ABSENT]
    assert sorted(places) == sorted(TABLE)


@pytest.mark.long
@pytest.mark.parametrize("fault", STOPPED)
def test_a_fault_that_a_pressed_foot_feels_stops_the_stance(tmp_path, fault):
    seen = strike(tmp_path, fault)

    assert "Traceback" not in seen.done.err + seen.done.out
    first = seen.rejected[0].removeprefix("interrupted: ")
    assert first in STOPPED[fault], seen.rejected
    reached = seen.scene.reached_ms(*STOPS.get(first, ("driven", ArmState.DAMP)))
    assert reached is not None, seen.scene.seen_since()
    assert reached <= SLOWEST_MS
    assert seen.scene.arm == "idle"
    motion = seen.truth.since(seen.scene.struck_ns, fault)
    assert is_within(motion, PRESSED), motion


@pytest.mark.long
@pytest.mark.parametrize("fault", ENDED)
def test_a_fault_that_takes_the_arm_away_ends_the_session(tmp_path, fault):
    seen = strike(tmp_path, fault)

    assert seen.done.code == 4, seen.done.err
    assert "Traceback" not in seen.done.err
    assert seen.rejected == [f"interrupted: {ENDED[fault]}"]
    assert seen.scene.reached_ms("idle", None) is not None
    assert seen.scene.arm == "idle"
    motion = seen.truth.since(seen.scene.struck_ns, fault)
    assert is_within(motion, PRESSED), motion
    assert resume(seen.data).code == 0


@pytest.mark.long
@pytest.mark.parametrize("fault", LATER)
def test_a_puck_that_changes_in_a_stance_is_found_after_it(tmp_path, fault):
    seen = strike(tmp_path, fault)

    assert (seen.done.code, seen.rejected) == (0, [])
    motion = seen.truth.since(seen.scene.struck_ns, fault)
    assert is_within(motion, PRESSED), motion


@pytest.mark.long
@pytest.mark.parametrize("fault", UNSEEN)
def test_an_encoder_that_stands_still_while_the_sole_stands_costs_nothing(
    tmp_path, fault
):
    seen = strike(tmp_path, fault)

    assert (seen.done.code, seen.rejected) == (0, [])
    motion = seen.truth.since(seen.scene.struck_ns, fault)
    assert motion.travel < MOST_TRAVEL
    assert is_within(motion, PRESSED), motion
