"""The fault matrix: every fault in every phase, run through the whole program.

In stepped time, it checks the messages, the arm, the files and the resumed session.
"""

import re
from pathlib import Path

from acquisition.control_loop.states import ArmState
from tests.attacks.attack import Attack, RunBy
from tests.experiments.program import kept_and_sound, write_config
from tests.faults.bounds import BOUND_PHASES, cells_of_all, read_bounds
from tests.faults.expected import DAMPED_OR_IDLE, TABLE, Arm, Cell, End
from tests.faults.phases import MOVING
from tests.faults.rehearse import Seen, SimulatedScene, resume, run_with
from tests.faults.strikes import strike_of
from tests.faults.truth import is_within, promise_of

ALLOWANCE_MS = 20.0  # beyond the detection limit of the fault
CODES = {
    End.COMPLETE: 0,
    End.REFUSED: 3,
    End.NOT_ACTIVATED: 3,
    End.REPORTED: 0,
    End.REDONE: 0,
    End.UNTARED: 3,
    End.UNBRACKETED: 0,
    End.ENDED: 4,
    End.UNSTARTED: 2,
    End.UNWRITTEN: 6,
}
NOTHING = {End.REFUSED, End.UNSTARTED}
SEVERAL_LINES = {End.UNWRITTEN, End.UNTARED, End.UNBRACKETED}
WHOLE = {End.COMPLETE, End.REPORTED, End.REDONE, End.UNBRACKETED}
# One fault of each kind, each in another phase.
DAILY = {
    ("puck-silent", "idle"),
    ("safety-torque", "tare"),
    ("estop", "end"),
    ("overspeed", "review"),
    ("ft-garbled", "preflight"),
    ("bus-shared", "preflight"),
    ("can-silence", MOVING),
    ("overspeed", MOVING),
    ("safety-silent", MOVING),
}
WHOLE_TRIALS = {
    ("stall-150-ms", "recording"),
    ("bus-shared", "recording"),
    ("creep-of-motor-2", "recording"),
}


_OF_ANOTHER_MOTOR = re.compile(r"-[13-7]$")  # motor 2 represents the others


def fault_attacks() -> list[Attack]:
    """Return every possible cell of the matrix."""
    return [_attack(*row) for row in cells_of_all()]


def _attack(fault: str, phase: str, cell: Cell) -> Attack:
    def check(folder: Path) -> None:
        check_cell(fault, phase, cell, folder)

    holds = "; ".join(part for part in (cell.end.value, _arm_words(cell)) if part)
    return Attack(fault, phase, holds, check, run_by(fault, phase), seconds=240)


def _arm_words(cell: Cell) -> str:
    """Return the reaction of the arm and its time in words."""
    if cell.arm is None:
        return f"arm: {cell.at_rest} at the end"
    reaction = cell.arm.text or cell.arm.seen
    return f"arm: {reaction}, within {cell.arm.limit_ms + ALLOWANCE_MS:.0f} ms"


def run_by(fault: str, phase: str) -> RunBy:
    """Return the command that runs a cell; each commit runs one of every kind."""
    if (fault, phase) in DAILY:
        return RunBy.TEST
    is_covered = _OF_ANOTHER_MOTOR.search(fault) or fault in {name for name, _ in DAILY}
    is_in_turn = not is_covered and phase == _phase_in_turn(fault)
    return RunBy.CI if is_in_turn or (fault, phase) in WHOLE_TRIALS else RunBy.NIGHTLY


def _phase_in_turn(fault: str) -> str:
    """Return the phase in which CI runs a fault; adjacent rows differ."""
    if fault == "suspended-1-s":  # the other phases take a minute
        return "recording"
    phases = [phase for name, phase, _ in cells_of_all() if name == fault]
    return phases[list(TABLE).index(fault) % len(phases)]


def check_cell(fault: str, phase: str, cell: Cell, folder: Path) -> None:
    """Run a session of one trial, or a calibration, with a fault in a phase."""
    config = write_config(folder)
    seen = run_with(strike_of(fault), phase, config, folder / "data")
    assert seen.scene.strikes == 1
    check_words(seen, cell)
    check_arm(seen, cell)
    check_truth(seen, fault, phase, cell)
    if phase == MOVING:
        assert (seen.written is not None) is (cell.end is End.COMPLETE)
        assert seen.folder is None
        return
    check_files(seen, cell)
    check_resume(seen, cell)


def check_words(seen: Seen, cell: Cell) -> None:
    done = seen.done
    assert "Traceback" not in done.err + done.out
    if cell.end is End.SOMEHOW:
        assert done.code in {0, 4, 5}, done.err  # 5: abandoned without a tare
        return
    if cell.end is End.UNMEASURED:
        assert done.code in {3, 4}, done.err
        assert cell.text in done.err
        assert "Nothing was written." in done.err
        assert cell.arm is None or f"ARM: {cell.arm.text}" in done.err
        return
    assert done.code == CODES[cell.end], done.err
    if cell.end is End.COMPLETE:
        assert cell.then in done.err if cell.then else done.err == ""
        assert cell.text in done.out
        return
    (*lines, last) = done.err.splitlines()
    if cell.then:
        assert cell.then in last
        (*lines, last) = lines
    assert lines == [] or cell.end in SEVERAL_LINES
    assert cell.text in last
    if cell.end is End.UNBRACKETED:
        assert "No tare at the end" in done.out
    if cell.arm is not None:
        assert f"ARM: {cell.arm.text}" in last


def check_arm(seen: Seen, cell: Cell) -> None:
    """Check the arm, as seen by its pucks, against the table."""
    scene = seen.scene
    assert scene.arm == cell.at_rest
    if cell.end in NOTHING:
        assert all(arm != "driven" for _, arm, _ in scene.seen)
    if cell.arm is not None:
        reached = reached_ms(scene, cell.arm)
        assert reached is not None, scene.seen_since()
        assert reached <= cell.arm.limit_ms + ALLOWANCE_MS


def reached_ms(scene: SimulatedScene, arm: Arm) -> float | None:
    """Return the time from the fault to the reaction [ms]; None = never."""
    if arm.seen != DAMPED_OR_IDLE:
        return scene.reached_ms(arm.seen, arm.state)
    states = (("driven", ArmState.DAMP), ("idle", None))
    reached = [scene.reached_ms(*state) for state in states]
    return min((ms for ms in reached if ms is not None), default=None)


def check_truth(seen: Seen, fault: str, phase: str, cell: Cell) -> None:
    """Check the true motion of the arm against its limits and the printed bounds."""
    scene = seen.scene
    motion = seen.truth.since(scene.struck_ns, fault)
    assert is_within(motion, promise_of(fault, cell)), motion
    if phase in BOUND_PHASES:
        printed = read_bounds()[fault][phase]
        assert is_within(motion, printed.with_margin()), (motion, printed)


def check_files(seen: Seen, cell: Cell) -> None:
    if cell.end in NOTHING:
        assert seen.folder is None
        return
    if cell.end is End.SOMEHOW:
        assert seen.events[-1]["event"] == "session-ended"
        assert list(seen.data.rglob("*.partial")) == []
        return
    is_whole = cell.end in WHOLE
    if cell.end is not End.UNWRITTEN:
        assert seen.rejected == list(cell.rejected)
        assert kept_and_sound(seen.folder) == (["T01"] if is_whole else [])
        assert list(seen.data.rglob("*.partial")) == []
        assert seen.events[-1]["event"] == "session-ended"
    for why in cell.rejected:
        is_fault = why.startswith("interrupted")
        flight = seen.folder / "faults" / "T01a.flight.mcap"
        assert flight.exists() is is_fault


def check_resume(seen: Seen, cell: Cell) -> None:
    """Check that an incomplete session is completed and a complete one unchanged."""
    if seen.folder is None:
        return
    done = resume(seen.data)
    if cell.end is End.SOMEHOW:
        assert done.code in {0, 2}, done.err
        return
    is_left = cell.end not in WHOLE
    if cell.end is End.UNWRITTEN:
        # The part of the journal on the disk decides.
        is_left = done.code == 0
        assert is_left or done.err.startswith("There is no unfinished session")
        return
    assert done.code == (0 if is_left else 2), done.err
    assert kept_and_sound(seen.folder) == ["T01"]
