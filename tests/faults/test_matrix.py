"""Every fault in every phase through the whole program, on stepped time.

By default one cell of every fault, the phases taken in turn; all of them with
`-m long`. `python -m tests.faults` prints the matrix.
"""

import pytest

from acquisition.control_loop.states import ArmState
from tests.experiments.program import kept_and_sound, write_config
from tests.faults import rehearse
from tests.faults.bounds import BOUND_PHASES, COLUMNS, cells_of_all, read_bounds
from tests.faults.expected import DAMPED_OR_IDLE, TABLE, Cell, End
from tests.faults.moving import MOVING_CELLS
from tests.faults.phases import MOVING
from tests.faults.rehearse import resume, run_with
from tests.faults.strikes import strike_of
from tests.faults.truth import is_within, promise_of

pytestmark = pytest.mark.timeout(240)  # two simulated minutes on a busy machine
ALLOWANCE_MS = 20.0  # beyond the fault's own limit
CODES = {
    End.COMPLETE: 0,
    End.REFUSED: 3,
    End.NOT_ACTIVATED: 3,
    End.TOLD: 0,
    End.REDONE: 0,
    End.UNTARED: 3,
    End.UNBRACKETED: 0,
    End.ENDED: 4,
    End.UNSTARTED: 2,
    End.UNWRITTEN: 6,
}
NOTHING = {End.REFUSED, End.UNSTARTED}
SEVERAL_LINES = {End.UNWRITTEN, End.UNTARED, End.UNBRACKETED}
WHOLE = {End.COMPLETE, End.TOLD, End.REDONE, End.UNBRACKETED}
# One fault of each kind by default, each in another phase; the rest is long.
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


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    return write_config(tmp_path_factory.mktemp("config"))


def marks_of(cell):
    """Return when a cell is run: by default, with whole sessions, or by hand."""
    if cell in WHOLE_TRIALS:
        return [pytest.mark.slow]
    return [] if cell in DAILY else [pytest.mark.long]


def marked():
    """Return every cell as a parameter, most of them marked long."""
    return [
        pytest.param(
            fault,
            phase,
            cell,
            id=f"{fault}-{phase}",
            marks=marks_of((fault, phase)),
        )
        for fault, phase, cell in cells_of_all()
    ]


@pytest.mark.parametrize(("fault", "phase", "cell"), marked())
def test_a_fault_comes_to_what_the_table_says(config, tmp_path, fault, phase, cell):
    seen = run_with(strike_of(fault), phase, config, tmp_path / "data")
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


def check_words(seen, cell: Cell) -> None:
    done = seen.done
    assert "Traceback" not in done.err + done.out
    if cell.end is End.SOMEHOW:
        assert done.code in {0, 4, 5}, done.err  # 5: no tare, given up
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


def check_arm(seen, cell: Cell) -> None:
    """Hold the arm against the table, in the eyes of its pucks."""
    scene = seen.scene
    assert scene.arm == cell.at_rest
    if cell.end in NOTHING:
        assert all(arm != "driven" for _, arm, _ in scene.seen)
    if cell.arm is not None:
        reached = reached_ms(scene, cell.arm)
        assert reached is not None, scene.seen_since()
        assert reached <= cell.arm.limit_ms + ALLOWANCE_MS


def reached_ms(scene, arm):
    """Return how long after the strike the arm did so; None = never."""
    if arm.seen != DAMPED_OR_IDLE:
        return scene.reached_ms(arm.seen, arm.state)
    ways = (("driven", ArmState.DAMP), ("idle", None))
    reached = [scene.reached_ms(*way) for way in ways]
    return min((ms for ms in reached if ms is not None), default=None)


def check_truth(seen, fault: str, phase: str, cell: Cell) -> None:
    """Hold the simulated arm itself against the limits and the printed bounds."""
    scene = seen.scene
    motion = seen.truth.since(scene.struck_ns, fault)
    assert is_within(motion, promise_of(fault, cell)), motion
    if phase in BOUND_PHASES:
        printed = read_bounds()[fault][phase]
        assert is_within(motion, printed.with_margin()), (motion, printed)


def check_files(seen, cell: Cell) -> None:
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


def check_resume(seen, cell: Cell) -> None:
    """A session that is not complete is completed; one that is needs nothing."""
    if seen.folder is None:
        return
    done = resume(seen.data)
    if cell.end is End.SOMEHOW:
        assert done.code in {0, 2}, done.err
        return
    is_left = cell.end not in WHOLE
    if cell.end is End.UNWRITTEN:
        # What the disk has of the journal decides.
        is_left = done.code == 0
        assert is_left or done.err.startswith("There is no unfinished session")
        return
    assert done.code == (0 if is_left else 2), done.err
    assert kept_and_sound(seen.folder) == ["T01"]


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.05, 0.25, 0.33, 0.4, 0.44])
@pytest.mark.parametrize("fault", ["replies-late", "replies-late-3", "puck-late"])
def test_late_positions_are_found_soon_enough_from_any_moment_of_a_move(
    fault, speed, config, tmp_path, monkeypatch
):
    # The cycle that asks for none comes just after the strike, or a tenth of a second.
    monkeypatch.setattr(rehearse, "MOVING_SPEED", speed)
    seen = run_with(strike_of(fault), MOVING, config, tmp_path / "data")
    motion = seen.truth.since(seen.scene.struck_ns, fault)
    cell = MOVING_CELLS[fault]
    assert motion.idle_ms is not None
    assert motion.idle_ms <= cell.arm.limit_ms + ALLOWANCE_MS
    assert is_within(motion, promise_of(fault, cell)), motion
    assert motion.speed <= 0.6


def test_every_cell_that_cannot_exist_says_why():
    absent = [c for row in TABLE.values() for c in row if c.end is End.ABSENT]
    assert absent
    assert all(cell.why for cell in absent)


def test_every_phase_and_every_end_is_in_the_table():
    assert {phase for _, phase, _ in cells_of_all()} == set(COLUMNS)
    assert {cell.end for _, _, cell in cells_of_all()} == {
        *CODES,
        End.SOMEHOW,
        End.UNMEASURED,
    }


def test_an_arm_that_moves_by_itself_meets_every_fault_of_the_table():
    assert set(MOVING_CELLS) == set(TABLE)


def test_every_fault_has_a_printed_bound_and_no_other_has():
    printed = read_bounds()
    assert {(f, p) for f, row in printed.items() for p in row} == {
        (fault, phase) for fault, phase, _ in cells_of_all() if phase in BOUND_PHASES
    }


def test_the_daily_cells_are_in_the_table():
    assert {(fault, phase) for fault, phase, _ in cells_of_all()} >= DAILY
