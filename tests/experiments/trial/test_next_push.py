"""What is suggested between two trials, from the sidecars of the kept ones."""

import json

import numpy as np
import pytest

from analysis.data.quality import CoverageGrid, suggest
from analysis.next_push.aims import AIMS
from analysis.next_push.records import ROWS, Aim, PushRecord
from experiments.session.kept_files import enough_of
from experiments.session.store import SessionFolder
from experiments.settings.load import load_settings
from experiments.trial.quality import next_push

SPARSE = [[0, 0, 0, 0], [0, 900, 3, 0], [0, 900, 900, 0], [0, 0, 0, 0]]


def push(k, load, speed):
    """Return the record of a trial at a load and a velocity, its level off by 1 N."""
    rng = np.random.default_rng(k)
    F_n, v_t = load * rng.uniform(0.7, 1.3, ROWS), speed * rng.uniform(0.5, 1.5, ROWS)
    F_t = 2.0 + 0.8 * F_n + (-1.0) ** k + rng.normal(0.0, 0.3, ROWS)
    t = np.sort(rng.uniform(0.0, 12.0, ROWS))
    return PushRecord(
        F_n, v_t, F_t, t, load * rng.uniform(0.5, 1.5, 6), Aim(load, speed)
    )


def everywhere(count):
    return [push(k, 2.5 + (k % 6), 0.02 + 0.02 * (k % 5)) for k in range(count)]


@pytest.fixture
def row():
    return load_settings(None).matrix.terrains[0]


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "trials").mkdir()
    return SessionFolder(tmp_path, "S001", "S0", is_simulated=False)


def keep(folder, pushes, **changed):
    """Write a sidecar per trial; the changes are those of the last one."""
    for k, record in enumerate(pushes):
        details = {"verdict": "keep", "coverage": SPARSE, "push": record.plain()}
        details |= changed if k == len(pushes) - 1 else {}
        path = folder.trials / f"T{k + 1:02d}.json"
        path.write_text(json.dumps(details))


def test_the_push_that_teaches_most_is_suggested_with_its_aim(folder, row):
    keep(folder, [push(k, 2.5, 0.02) for k in range(3)])
    told = next_push(folder, row.model_copy(update={"target": "corner"}))
    assert told.aim == AIMS[-1]
    assert told.text.startswith("firmly (5.5 N), fast (0.065 m/s): F_t at ")
    assert told.enough == ""


def test_the_emptiest_cell_is_suggested_where_a_trial_has_no_record(folder, row):
    keep(folder, [push(k, 4.0, 0.04) for k in range(3)], push=None)
    told = next_push(folder, row)
    assert told.text == suggest(CoverageGrid(3 * np.array(SPARSE))) != ""
    assert told.aim is None


def test_before_the_first_kept_trial_nothing_is_suggested(folder, row):
    assert next_push(folder, row).text == ""


def test_rejected_trials_teach_nothing(folder, row):
    keep(folder, [push(0, 4.0, 0.04)], verdict="reject")
    assert next_push(folder, row).text == ""


def test_enough_is_said_with_what_the_matrix_wants(folder, row):
    row = row.model_copy(update={"trials": 20})
    keep(folder, everywhere(12))
    assert next_push(folder, row).enough.endswith("; 20 are wanted")
    line = enough_of([folder], row)
    assert line.startswith("S0: enough after 12: two more trials would move the grid")
    assert line.endswith("; 20 are wanted.")


def test_nothing_is_said_of_a_terrain_that_is_complete(folder, row):
    keep(folder, everywhere(12))
    for wanted in (row, row.model_copy(update={"trials": 12})):
        assert enough_of([folder], wanted) == ""
    more = row.model_copy(update={"trials": 13})
    assert enough_of([folder], more) != ""


def test_six_trials_are_not_enough(folder, row):
    row = row.model_copy(update={"trials": 20})
    keep(folder, everywhere(6))
    assert next_push(folder, row).enough == ""
    assert enough_of([folder], row) == ""
