"""Faults while the arm stands by itself: its foot pressed on the ground in a stance.

A stance is a recording; a fault comes to what the matrix says of one, and the true arm
keeps the same promises. Encoders that stand still or creep, and forces and sensors,
are not among these.
"""

import pytest

from tests.experiments.program import write_config
from tests.faults.expected import TABLE
from tests.faults.phases import PHASES, STANDING
from tests.faults.rehearse import run_with
from tests.faults.strikes import strike_of
from tests.faults.test_matrix import check_arm, check_files, check_resume, check_words
from tests.faults.truth import is_within, promise_of

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
)


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
    seen = run_with(
        strike_of(fault), STANDING, write_config(tmp_path), tmp_path / "data"
    )

    assert seen.scene.strikes == 1
    check_words(seen, cell)
    check_arm(seen, cell)
    motion = seen.truth.since(seen.scene.struck_ns, fault)
    assert is_within(motion, promise_of(fault, cell)), motion
    check_files(seen, cell)
    check_resume(seen, cell)
