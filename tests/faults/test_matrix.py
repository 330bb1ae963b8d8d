"""Every fault in every phase through the whole program, in stepped time."""

import pytest

from tests.attacks.parameters import parameters
from tests.experiments.program import write_config
from tests.faults import rehearse
from tests.faults.bounds import BOUND_PHASES, COLUMNS, cells_of_all, read_bounds
from tests.faults.expected import TABLE, End
from tests.faults.matrix import ALLOWANCE_MS, CODES, DAILY, WHOLE_TRIALS, fault_attacks
from tests.faults.moving import MOVING_CELLS
from tests.faults.phases import MOVING
from tests.faults.rehearse import run_with
from tests.faults.strikes import strike_of
from tests.faults.truth import is_within, promise_of


@pytest.mark.parametrize("row", parameters(fault_attacks()))
def test_a_fault_has_the_outcome_in_the_table(row, tmp_path):
    row.check(tmp_path)


@pytest.mark.long
@pytest.mark.timeout(240)
@pytest.mark.parametrize("speed", [0.05, 0.25, 0.33, 0.4, 0.44])
@pytest.mark.parametrize("fault", ["replies-late", "replies-late-3", "puck-late"])
def test_late_positions_are_detected_in_time_at_any_moment_of_a_move(
    fault, speed, tmp_path, monkeypatch
):
    # The cycle without a request follows the strike at once or after 0.1 s.
    monkeypatch.setattr(rehearse, "MOVING_SPEED", speed)
    seen = run_with(strike_of(fault), MOVING, write_config(tmp_path), tmp_path / "data")
    motion = seen.truth.since(seen.scene.struck_ns, fault)
    cell = MOVING_CELLS[fault]
    assert motion.idle_ms is not None
    assert motion.idle_ms <= cell.arm.limit_ms + ALLOWANCE_MS
    assert is_within(motion, promise_of(fault, cell)), motion
    assert motion.speed <= 0.6


def test_every_excluded_cell_states_its_reason():
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


def test_a_moving_arm_is_tested_with_every_fault():
    assert set(MOVING_CELLS) == set(TABLE)


def test_exactly_the_faults_of_the_table_have_a_bound():
    printed = read_bounds()
    assert {(f, p) for f, row in printed.items() for p in row} == {
        (fault, phase) for fault, phase, _ in cells_of_all() if phase in BOUND_PHASES
    }


def test_cells_run_at_each_commit_are_in_the_table():
    cells = {(fault, phase) for fault, phase, _ in cells_of_all()}
    assert cells >= DAILY | WHOLE_TRIALS
